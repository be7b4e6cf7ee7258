"""Iteration: a group used several times in sequence; each turn reads outputs of the previous one.

``rough: {group: pass, repeat: 4, carry: {height: height}}`` is four uses, ``rough.1`` to
``rough.4``, in a group of their own, so that turns behave like any other uses.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from tactograph.graph.declare.ports import CONDITION_INPUT, RESTING_INPUT
from tactograph.graph.errors import GraphError
from tactograph.graph.files.flat_graph import Graph, Group, Param, Use, params_in

Turns = Sequence[Mapping[str, Any]]
"""The params of each turn, in addition to those of all turns."""


def in_turns(
    use: Use, turns: Turns | None, carry: Mapping[str, str] | None, going: str | None
) -> Use:
    """Return the use unchanged, or a use of all turns if it is repeated.

    `carry` maps an input of a turn to the output of the previous turn that it reads.  `going` is an
    output; once it is zero, further turns rest and repeat the previous one.  Raises GraphError if
    `turns` or `carry` is missing.
    """
    if not turns and not carry:
        if going:
            raise GraphError(f"{use.where('while')}: 'while' needs 'repeat'")
        return use
    if not turns or not carry:
        stated, missing = ("repeat", "carry") if turns else ("carry", "repeat")
        raise GraphError(f"{use.where(stated)}: '{stated}' needs '{missing}'")
    name = f"{len(turns)} x {use.group}"
    shared = {each: each for each in use.inputs if each != CONDITION_INPUT}
    values = [{**use.settings, **turn} for turn in turns]
    passed = {param for turn in values for param in params_in(turn).values()}
    uses: dict[str, Use] = {}
    for index, settings in enumerate(values):
        carried = {port: f"{index}.{output}" for port, output in carry.items()} if index else {}
        if going and index:
            carried |= {CONDITION_INPUT: f"{index}.{going}", RESTING_INPUT: str(index)}
        own = {f"with.{key}": f"repeat[{index}].{key}" for key in turns[index]}
        for port in carried:
            own[f"in.{port}"] = f"carry.{port}" if f"carry.{port}" in use.places else "while"
        places = {**use.places, **{key: use.place(at) for key, at in own.items()}}
        uses[str(index + 1)] = Use(use.group, {**shared, **carried}, settings, places)
    params = {each: Param("") for each in passed}
    body = Graph(name, params=params, places=use.places, uses=uses)
    return replace(
        use,
        group=name,
        settings={each: f"${each}" for each in passed},
        turns=Group({each: Param("") for each in shared}, body),
    )
