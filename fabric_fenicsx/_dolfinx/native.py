"""C and C++ made into functions at run time, by cffi, into a folder where later runs find them."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import platform
import re
import sysconfig
import tempfile
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import cffi

__all__ = ["built"]


def built(
    name: str,
    source: Callable[[], str],
    folder: Path,
    *,
    key: str,
    options: Sequence[str],
    extension: str = ".c",
) -> Any | None:
    """Functions of a source file, those not static, which take numbers and pointers.

    Args:
        name: of the module to be.
        source: gives what is compiled.
        folder: where modules are kept.
        key: what tells this source from others of the name; options, machine and Python are told
            apart by themselves.
        options: of the compiler.
        extension: ".c" or ".cpp".

    Returns:
        The cffi module, with ``lib`` and ``ffi``; None where it can neither be found nor compiled.
    """
    suffix = str(sysconfig.get_config_var("EXT_SUFFIX"))
    told = hashlib.sha256("\n".join([key, *options, platform.machine(), suffix]).encode())
    name = f"{name}_{told.hexdigest()[:32]}"
    library = folder / (name + suffix)
    try:
        if not library.exists():
            text = source()
            builder = cffi.FFI()
            builder.cdef(
                ";\n".join(re.findall(r"^(?:int64_t|void) \w+\([^{]*\)", text, re.M)) + ";"
            )
            builder.set_source(
                name, text, source_extension=extension, extra_compile_args=list(options)
            )
            folder.mkdir(parents=True, exist_ok=True)
            # In a folder of its own and moved when it is whole: another process may do the same.
            with tempfile.TemporaryDirectory(dir=folder) as own, redirect_stdout(StringIO()):
                os.replace(builder.compile(tmpdir=own), library)
        spec = importlib.util.spec_from_file_location(name, library)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module
    # What cffi and distutils raise without a compiler has no common class.
    except Exception:
        return None
