"""The drape as a film: pictures drawn one after the other, joined to a GIF or an MP4."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabric.net import Net
from fabric_fenicsx.output.files import replacing
from fabric_fenicsx.output.lines import COLOURS, scale_limits, tow_lines
from fabric_fenicsx.output.pictures import colour_map, draw_net
from fabric_fenicsx.output.surfaces import TriangleSurface, triangles
from fabric_fenicsx.solving.snapshot import Snapshot

from ..arrays import Array

__all__ = ["encoder", "write_film"]

HELD = 8
"""Times that the last picture is shown."""

SHADES = 128
"""Of the colour scale that a GIF's palette of 255 is made for."""


def encoder(path: Path) -> str | None:
    """The program that makes this film; None for a GIF, which Pillow makes.

    Raises:
        InputError: another ending than .gif or .mp4, or nothing here makes an MP4.
    """
    if path.suffix == ".gif":
        return None
    if path.suffix != ".mp4":
        raise InputError(f"{path}: allowed is a film, .gif or .mp4")
    found = shutil.which("ffmpeg")
    if found is None:
        try:
            found = import_module("imageio_ffmpeg").get_ffmpeg_exe()
        except (ImportError, RuntimeError):
            raise InputError(
                f"{path}: an .mp4 needs ffmpeg; pip install imageio-ffmpeg brings it, "
                "a .gif needs nothing"
            ) from None
    return found


def write_film(
    path: Path,
    frames: Sequence[tuple[Net, Snapshot, list[TriangleSurface]]],
    *,
    colour: str = "shear_angle",
    view: str = "perspective",
    size: tuple[int, int] = (800, 600),
    rate: float = 12.0,
    progress: Callable[[int], None] = lambda done: None,
) -> None:
    """Draw the frames with one camera and one colour scale and join them.

    Args:
        path: the film, .gif or .mp4; its folder is made.
        frames: net, state and tools in their places.
        colour: what colours the tows, a key of `lines.COLOURS`.
        view: a key of `pictures.VIEWS`.
        size: width and height [pixels], even numbers for an .mp4.
        rate: pictures per second.
        progress: told how many are drawn.

    Raises:
        InputError: nothing here makes such a film.
        OSError: it cannot be written.
    """
    program = encoder(path)
    quantity = COLOURS[colour]
    values = [line.values for net, s, _ in frames for line in tow_lines(net, s, quantity)]
    limits = scale_limits(quantity, np.concatenate(values))
    frame = np.concatenate(
        [
            cloud
            for net, snapshot, tools in frames
            for cloud in (
                net.points + snapshot.displacement,
                *(triangles(tool)[0] for tool in tools),
            )
        ]
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as folder:
        pictures = []
        for number, (net, snapshot, tools) in enumerate(frames):
            pictures.append(Path(folder) / f"{number:05d}.png")
            draw_net(
                pictures[-1],
                net,
                snapshot,
                surfaces=tools,
                view=view,
                colour=colour,
                limits=limits,
                title=f"t = {snapshot.time:.1f} s",
                size=size,
                frame=frame,
            )
            progress(number + 1)
        with replacing(path) as partial:
            if program is None:
                _gif(partial, pictures, rate, colour_map(quantity, limits))
            else:
                _mp4(program, partial, Path(folder), len(pictures), rate)


def _gif(path: Path, pictures: list[Path], rate: float, colours: Array) -> None:
    from PIL import Image

    images = [Image.open(picture).convert("RGB") for picture in pictures]
    # One palette for all, or the colours flicker. The last picture has the most of them, and the
    # whole scale beside it, or the few pixels of the scale would get too few to look continuous.
    width, height = images[-1].size
    scale = Image.fromarray(np.uint8(255 * colours[None, :: len(colours) // SHADES]))
    both = Image.new("RGB", (width, 2 * height))
    both.paste(images[-1])
    both.paste(scale.resize((width, height), Image.Resampling.NEAREST), (0, height))
    palette = both.quantize(255)
    images = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    durations = [round(1000.0 / rate)] * len(images)
    durations[-1] *= HELD
    images[0].save(path, save_all=True, append_images=images[1:], duration=durations, loop=0)


def _mp4(program: str, path: Path, folder: Path, count: int, rate: float) -> None:
    last = (folder / f"{count - 1:05d}.png").read_bytes()
    for number in range(count, count + HELD - 1):
        (folder / f"{number:05d}.png").write_bytes(last)
    command = [program, "-y", "-loglevel", "error", "-framerate", f"{rate:g}"]
    command += ["-i", str(folder / "%05d.png"), "-pix_fmt", "yuv420p", "-crf", "20", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise OSError(f"{path}: {' '.join(done.stderr.split())[:300]}")
