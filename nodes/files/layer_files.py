"""Layers of a touch as files of a result's folder: ``NAME.npy`` or ``NAME.png``, and pictures."""

from collections.abc import Collection
from pathlib import Path

import numpy as np

from tactograph.graph.declare.ports import read_port
from tactograph.nodes.files.image_files import ImageFile
from tactograph.nodes.stream.touch import Layer, LayerKinds


def write_layer(layer: Layer, folder: Path) -> None:
    """Write floats as ``.npy``, whole numbers as an image, flags as 0 and 255; no record."""
    name, value = layer.name, layer.value
    if not isinstance(value, np.ndarray):
        return
    if value.dtype.kind == "f":
        np.save(folder / f"{name}.npy", value)
        return
    is_flag = read_port(name, layer.kind.quantity).unit == "flag"
    ImageFile(folder / f"{name}.png").write(value * np.uint8(255) if is_flag else value)


def picture_file(layer: Layer, folder: Path) -> Path:
    """Return the place of a layer's picture, beside the image that holds the layer itself."""
    is_image = layer.value.dtype.kind != "f"
    return folder / (f"{layer.name}_view.png" if is_image else f"{layer.name}.png")


def layer_files(names: Collection[str]) -> dict[str, list[str]]:
    """Return which of a result's files are of a layer, by the layer's name."""
    of_layers = {
        layer: [f for f in (f"{layer}.npy", f"{layer}.png", f"{layer}_view.png") if f in names]
        for layer in LayerKinds()
    }
    return {layer: files for layer, files in of_layers.items() if files}
