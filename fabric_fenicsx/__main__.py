"""Entry point of `fabric-fenicsx` and of `python -m fabric_fenicsx`."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from .processor import choose_kernels
from .startup import collect_seldom, end_soon, stand_in_for_pkg_resources

__all__ = ["main"]

#: Commands that factorise large matrices. Faster kernels go by where arrays lie in memory, so that
#: their last digits differ from run to run: no gain to a diagnosis, which reports the same twice.
SOLVING = ("run", "converge")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit: 0, 1 for a solve that stopped, 2 for bad input."""
    # Parallelism is MPI's; threads of BLAS on top of it only get in each other's way.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    given = sys.argv[1:] if arguments is None else arguments
    solving = bool(given) and given[0] in SOLVING
    if solving:
        choose_kernels()
        stand_in_for_pkg_resources()
    # Given arguments the process is another's, and goes on.
    if solving and arguments is None:
        collect_seldom()
    if not os.environ.get("DISPLAY"):
        # VTK tries an X server first and complains when there is none.
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")

    from .cli import app
    from .cli.collective import say
    from .errors import InputError, SolveError
    from .parallel import launched, rank

    if launched():
        # Of Mesa, which draws for VTK: other ranks draw beside this one.
        os.environ.setdefault("LP_NUM_THREADS", "0")
    if rank() != 0:
        sys.stdout = open(os.devnull, "w")
    try:
        code = app(list(arguments) if arguments is not None else None, standalone_mode=False)
    except KeyboardInterrupt:
        code = 130
    except (InputError, SolveError) as error:
        say(" ".join(str(error).split()))
        code = error.exit_code
    except BrokenPipeError:
        # Whoever read along has seen enough.
        sys.stdout = open(os.devnull, "w")
        code = 0
    except OSError as error:
        # What a command without results of its own could not read or write.
        place = f"{error.filename}: " if error.filename else ""
        say(f"{place}{error.strerror or ' '.join(str(error).split())}")
        code = InputError.exit_code
    except Exception as error:
        # Typer's own errors have no common public class; this is what they have in common.
        if not hasattr(error, "format_message"):
            raise
        message = " ".join(error.format_message().split())
        if message:
            say(f"{message} (fabric-fenicsx --help lists what is allowed)")
        if launched():
            # mpirun ends all ranks with the first that leaves: leave together, after the line.
            from mpi4py import MPI

            MPI.COMM_WORLD.barrier()
        code = InputError.exit_code
    sys.stdout.flush()
    if solving and arguments is None:
        end_soon()
    sys.exit(code)


if __name__ == "__main__":
    main()
