"""The parity suite can fail: it catches every one of these deliberate mistakes.

They are next to the kernels: ``kernels/light/flat_field.mutants.toml`` holds lines of
``"what is wrong" = ["what flat_field.cl or a header of it says", "what the mutant says"]``.
"""

import itertools
import re
import tomllib
from collections.abc import Iterator, Mapping

import pytest

from tactograph.graph.backends.compiled_node import Compiled
from tactograph.graph.backends.devices import choose_device
from tactograph.graph.backends.kernel import Kernel
from tactograph.graph.backends.kernel_source import kernel_signatures, kernel_source
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.backends.parity import compare
from tactograph.graph.backends.parity_cases import CASE_SHAPES, cases
from tactograph.graph.declare.find_node import find_node, shipped_nodes
from tactograph.graph.declare.node import Node
from tactograph.nodes.height import height_networks
from tests.each import each
from tests.fixtures import ROOT
from tests.kernels.pairwise import pairwise

SUFFIX = ".mutants.toml"
FILES = {
    file.name.removesuffix(SUFFIX): file
    for folder in ("kernels", "rings")
    for file in sorted((ROOT / folder).rglob(f"*{SUFFIX}"))
}
MUTANTS: dict[str, dict[str, list[str]]] = {
    name: tomllib.loads(file.read_text(encoding="utf-8")) for name, file in FILES.items()
}
LISTED = [(name, what) for name, mutants in MUTANTS.items() for what in mutants]
KERNEL = re.compile(r"^[^\n]*\b__kernel\b.*?^}", re.MULTILINE | re.DOTALL)


@each("name", MUTANTS)
def test_the_mutants_of_a_kernel_fit_it(name: str) -> None:
    file = FILES[name]
    assert file.with_name(f"{name}.cl").is_file(), f"{file} is next to no {name}.cl"
    source = kernel_source(find_node(name))
    stale = [what for what, (before, _) in MUTANTS[name].items() if before not in source]
    assert not stale, f"{file.relative_to(ROOT)} names code that {name}.cl no longer has: {stale}"


@pytest.mark.one_case
@pytest.mark.parametrize(("name", "what"), LISTED, ids=[f"{n}: {w}" for n, w in LISTED])
def test_parity_catches_the_mutant(name: str, what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    before, after = MUTANTS[name][what]
    build = Compiled._build

    def build_mutant(compiled: Compiled, constants: Mapping[str, int]) -> dict[str, Kernel]:
        source = compiled.source
        mutant = source.replace(before, after)
        right = build(compiled, constants)
        with monkeypatch.context() as patch:
            patch.setattr(compiled, "source", mutant)
            wrong = build(compiled, constants)
        changed = wrong_kernels(source, mutant)
        return {name: (wrong if name in changed else right)[name] for name in right}

    monkeypatch.setattr(Compiled, "_build", build_mutant)
    # Without this, small frames have levels of one work-group alone.
    monkeypatch.setattr(height_networks, "ONE_GROUP_PIXELS", 128)
    assert any(differences(find_node(name)))


def wrong_kernels(source: str, mutant: str) -> set[str]:
    """The kernels that contain a mistake: all of them if it is outside of kernels.

    The others need not be compiled again for each mutant of a node of forty kernels.
    """
    texts = [
        dict(zip(kernel_signatures(s), KERNEL.findall(s), strict=True)) for s in (source, mutant)
    ]
    if KERNEL.sub("", source) != KERNEL.sub("", mutant):
        return {*texts[1]}
    return {name for name, text in texts[1].items() if text != texts[0][name]}


@pytest.mark.slow
@pytest.mark.parametrize("name", MUTANTS)
def test_a_kernel_is_no_mutant_of_itself(name: str) -> None:
    """Compiled as the mutants are, it agrees."""
    assert not any(itertools.islice(differences(find_node(name)), 3))


def differences(node: Node) -> Iterator[str | None]:
    """The result of parity for a node, case by case, first the cases that most mutants fail.

    Without optimisation, which takes half of the compiler's time and hides no mistake.
    """
    chosen, _ = choose_device()
    assert chosen is not None
    device = OpenCL(chosen)
    device.options.append("-cl-opt-disable")
    every = cases(node) + pairwise(node, CASE_SHAPES[:3])
    for case in sorted(every, key=lambda case: abs(case.sizes.get("H", 0) - CASE_SHAPES[2][0])):
        yield compare(node, case, device)


def test_every_kernel_of_the_flow_has_mutants() -> None:
    kernels = {name for name in shipped_nodes() if find_node(name).has_kernel}
    assert kernels - set(MUTANTS) <= {"render", "press"}, "tested against analytic scenes instead"
