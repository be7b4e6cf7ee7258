"""Print and draw all that is in a file.

Long because calibrations and results each have a module of their own.
"""

from pathlib import Path

import click

from tactograph.rings.export.nodes.show._calibration import show_calibration
from tactograph.rings.export.nodes.show._capture import show_capture
from tactograph.rings.export.nodes.show._result import show_result
from tactograph.rings.export.summary import Summary
from tactograph.sdk import InputError, StoredResult, atomic_files, brought, node, one_line


@node
def show_file(*, file: Path, folder: Path | None = None) -> None:
    """Print a file's contents; draw a calibration or a lens.

    Parameters
    ----------
    file
        A calibration or a lens (``.npz``), a result (its folder or its ``result.json``), what a
        ring can show, such as a recording (``.mcap``) or a batch's store (``.zarr``), or a folder
        of those, or captures: a folder of images, a scan, or a folder of such.
    folder : where the pictures go; None: none are drawn

    Raises
    ------
    InputError
        If the file is none of these, or damaged.
    WriteError
        If a picture cannot be written.
    """
    content = _look(file)
    click.echo("\n".join(map(one_line, content.lines)))
    if folder is None:
        return
    with atomic_files(folder) as target:
        for name, draw in content.pictures.items():
            draw(target / name)
    for name in content.pictures:
        click.echo(one_line(f"drawn: {folder / name}"))


def _look(file: Path) -> Summary:
    if (result := StoredResult.file_of(file)) is not None:
        return show_result(result)
    if file.suffix == ".npz" and file.is_file():
        return show_calibration(file)
    shows = brought("show")
    if (further := shows.get(file.suffix[1:])) is not None:
        content: Summary = further.load().show(file)
        return content
    if file.is_dir():
        for suffix, reader in shows.items():
            if parts := sorted(file.glob(f"*.{suffix}")):
                show = reader.load().show
                return Summary([line for part in parts for line in show(part).lines])
        try:
            return show_capture(file)
        except InputError as error:  # its cure names parameters that this node does not have
            raise InputError(str(error).partition(";")[0]) from None
    others = "".join(f", a .{name}" for name in shows)
    raise InputError(
        f"{file}: nothing that can be shown; give a calibration or a lens (.npz){others}, the "
        "folder of a result, of a recording, or of captures ('tactograph draw' draws a graph)"
    )
