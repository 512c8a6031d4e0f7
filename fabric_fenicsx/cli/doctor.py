"""Whether this machine can run the package, and what mends it if it cannot."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module, metadata
from pathlib import Path

import typer

__all__ = ["doctor"]

DRAW = """
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from fabric_fenicsx.output.canvas import canvas
with TemporaryDirectory() as folder:
    with canvas(Path(folder) / "a.png", (64, 48), ()) as scene:
        import pyvista
        scene.add(pyvista.Sphere(), "#000000")
"""
"""Drawing may end the process that tries it."""

RANKS = "from mpi4py.MPI import COMM_WORLD as w; w.barrier(); w.rank or print(w.size)"


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing looked at.

    Attributes:
        what: its name.
        found: version or state; None if it is missing.
        mend: the Debian packages (first word "apt") or Python packages ("pip") that bring it.
        needed: whether the package cannot do without.
    """

    what: str
    found: str | None
    mend: str
    needed: bool = True


def doctor() -> None:
    """Look at what is installed: versions, ranks, compiler, JIT cache, drawing.

    What is missing is named with the one command that mends it. Exit code 1: something that is
    needed is missing.
    """
    from rich.console import Console
    from rich.table import Table

    findings = _findings()
    table = Table("", "what", "found")
    for finding in findings:
        mark = "ok" if finding.found else ("MISSING" if finding.needed else "-")
        table.add_row(mark, finding.what, finding.found or "not found")
    console = Console(highlight=False)
    console.print(table, width=None if console.is_terminal else 110)
    missing = [finding for finding in findings if finding.found is None and finding.needed]
    optional = [finding for finding in findings if finding.found is None and not finding.needed]
    if optional:
        packages = sorted({finding.mend.split(" ", 1)[1] for finding in optional})
        console.print(f"optional: pip install {' '.join(packages)}", soft_wrap=True)
    if missing:
        console.print(f"missing; this mends it: {_command(missing)}", soft_wrap=True)
        raise typer.Exit(1)
    console.print("all that is needed is here")


def _command(missing: list[Finding]) -> str:
    """One command line for all that is missing."""
    lines = []
    for tool, command in (
        ("apt", "sudo apt-get install --no-install-recommends"),
        ("pip", f"{sys.executable} -m pip install"),
    ):
        names = [f.mend.split(" ", 1)[1] for f in missing if f.mend.startswith(tool + " ")]
        if names:
            lines.append(f"{command} {' '.join(dict.fromkeys(names))}")
    return " && ".join(lines)


def _findings() -> list[Finding]:
    from .. import __version__

    system = platform.freedesktop_os_release().get("PRETTY_NAME", platform.system())
    return [
        Finding("fabric_fenicsx", f"{__version__} in {Path(__file__).parents[1]}", "pip ."),
        Finding("system", f"{system}, {platform.machine()}, {os.cpu_count()} cores", "apt base"),
        Finding("Python", f"{platform.python_version()}, {sys.executable}", "apt python3"),
        Finding("dolfinx", _tried(_dolfinx), "apt python3-dolfinx"),
        Finding("PETSc", _tried(_petsc), "apt python3-petsc4py"),
        Finding("MPI", _tried(_mpi), "apt python3-mpi4py"),
        Finding("two ranks", _tried(_two_ranks), "apt mpi-default-bin"),
        Finding("C compiler", _tried(_compiler), "apt gcc libc6-dev python3-dev"),
        Finding("JIT cache", _tried(_cache), "apt base-files"),
        Finding("gmsh", _tried(_gmsh), "apt python3-gmsh"),
        *(
            Finding(name, _tried(_version(name)), f"pip {name}")
            for name in ("numpy", "scipy", "pandas", "pydantic", "matplotlib", "pyvista", "vtk")
        ),
        Finding("drawing without a screen", _tried(_drawing), "apt libegl1 libgl1-mesa-dri"),
        Finding("meshio (other mesh formats)", _tried(_version("meshio")), "pip meshio", False),
        Finding("ffmpeg (films as MP4)", _tried(_ffmpeg), "pip imageio-ffmpeg", False),
        Finding("mkdocs (these pages)", _tried(_version("mkdocs")), "pip mkdocs", False),
    ]


def _tried(look: Callable[[], str | None]) -> str | None:
    """What a look finds; None where it fails, however it does."""
    try:
        return look()
    except Exception:
        return None


def _version(name: str) -> Callable[[], str]:
    return lambda: metadata.version(name)


def _dolfinx() -> str:
    return str(import_module("dolfinx").__version__)


def _petsc() -> str:
    petsc = import_module("petsc4py.PETSc")
    scalar = "real" if petsc.ScalarType().dtype.kind == "f" else "complex"
    if scalar != "real":
        raise RuntimeError(scalar)
    version = ".".join(map(str, petsc.Sys.getVersion()))
    solvers = [name for name in ("mumps", "superlu_dist") if petsc.Sys.hasExternalPackage(name)]
    return f"{version}, {scalar}, {' and '.join(solvers) or 'its own LU only'}"


def _mpi() -> str:
    mpi = import_module("mpi4py.MPI")
    return " ".join(mpi.Get_library_version().replace("\0", "").split()[:3]).rstrip(",")


def _two_ranks() -> str | None:
    launcher = Path("/usr/bin/mpirun")
    if not launcher.exists():
        return None
    done = _run([str(launcher), "-n", "2", sys.executable, "-c", RANKS])
    return f"{launcher} starts them" if done.stdout.split() == ["2"] else None


def _compiler() -> str | None:
    path = shutil.which(os.environ.get("CC", "cc")) or shutil.which("gcc")
    if path is None:
        return None
    return f"{path}, {_run([path, '--version']).stdout.splitlines()[0]}"


def _cache() -> str | None:
    folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fenics"
    folder.mkdir(parents=True, exist_ok=True)
    if not os.access(folder, os.W_OK):
        return None
    forms, size = 0, 0
    for path in folder.iterdir():
        forms += path.suffix == ".so"
        # What another process compiles right now comes and goes.
        with suppress(FileNotFoundError):
            size += path.stat().st_size
    return f"{folder}, {forms} compiled forms, {size / 1e6:.0f} MB"


def _gmsh() -> str:
    return str(import_module("gmsh").GMSH_API_VERSION)


def _drawing() -> str | None:
    return "works" if _run([sys.executable, "-c", DRAW]).returncode == 0 else None


def _ffmpeg() -> str:
    return shutil.which("ffmpeg") or str(import_module("imageio_ffmpeg").get_ffmpeg_exe())


def _run(command: list[str]) -> subprocess.CompletedProcess[str]:
    """A child process, free of the ranks that mpirun may have given this one."""
    env = {k: v for k, v in os.environ.items() if not k.startswith(("PMIX_", "OMPI_COMM", "PRTE"))}
    env |= {
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_rmaps_base_oversubscribe": "1",
        "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
        "OMPI_MCA_btl": "^tcp",
    }
    return subprocess.run(
        command,
        env=env,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=180,
        check=False,
    )
