"""The panel of the chosen node: its back end, its outputs, and a control for each parameter."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from nicegui import events, ui

from tactograph.rings.tune.attempt import attempt
from tactograph.rings.tune.controls import Control, control_of
from tactograph.rings.tune.follow import Follow
from tactograph.rings.tune.picture_view import ScaledPicture
from tactograph.rings.tune.pictures import draw, planes_of
from tactograph.rings.tune.tuning import State, Tuning
from tactograph.sdk import Document, Graph, nodes

SLIDER_INTERVAL_S = 0.02
"""Time between two places of a slider that is dragged; NiceGUI's own tells 20 a second."""
MAX_ENTRIES = 30
"""Entries of a mapping that are listed."""
MAX_PLANES = 4
"""Planes of a stack that are drawn beside each other."""
FILE_BACKEND = "as the graph says"
KEEP_TEXT_JS = "(e) => { Vue.toRaw(element).props.value = e.target.value"
EMIT_TEXT_JS = "emit(e.target.value)"


class NodePanel:
    """The card of the chosen node, rebuilt when another is chosen."""

    def __init__(self, tuning: Tuning, follow: Follow) -> None:
        self._tuning, self._follow = tuning, follow
        self._card = ui.column().classes("t-card gap-2").style("width: 43%; min-width: 0")
        self._shows: tuple[Graph, str | None, object] | None = None
        self._inside: _Inside | None = None
        self.build()

    def follow_others(self) -> None:
        """Take up changes by the file or another browser."""
        now, shows = self._chosen(), self._shows
        if shows is None or now[0] is not shows[0] or now != shows:
            self.build()

    def draw(self, state: State) -> None:
        """Draw the output of the node that is looked at."""
        name = self._tuning.request.node
        if name is None or state.result is None or (state.request and state.request.node != name):
            return
        if self._shows is None or self._shows[1] != name:
            return  # another browser has chosen it: the panel follows
        if self._inside is not None and name in state.result.plan.tasks:
            self._inside.draw(state)

    def build(self) -> None:
        """Rebuild the card."""
        tuning, name = self._tuning, self._tuning.request.node
        self._shows = self._chosen()
        self._card.clear()
        self._inside = None
        with self._card:
            if name is None or name not in tuning.graph.nodes:
                ui.label("A node").classes("t-title")
                ui.label(
                    "Click one in the graph: here are then its parameters, its back end, "
                    "what it does and what it makes."
                ).classes("t-help")
                return
            entry = tuning.graph.nodes[name]
            node = getattr(nodes, entry.op)
            about = node.about
            self._head(name)
            ui.label(about.summary.replace("``", "")).classes("t-help")
            if about.text:
                with ui.expansion("more").props("dense dense-toggle").classes("t-more w-full"):
                    ui.label(about.text.replace("``", "")).style("white-space: pre-line")
            if node.outputs:
                self._inside = _Inside(self._tuning, self._follow, name, [*node.outputs])
            for parameter, declared in node.parameters.items():
                words = about.arguments[parameter].replace("``", ""), declared.range
                self._parameter(name, parameter, " · ".join(filter(None, words)))

    def _head(self, name: str) -> None:
        """Name and op, and the controls of the node as a whole."""
        tuning, entry = self._tuning, self._tuning.graph.nodes[name]
        node = getattr(nodes, entry.op)
        with ui.row().classes("w-full items-center gap-2 no-wrap"):
            ui.label(name).classes("t-name").props("data-testid=node")
            ui.label(entry.op).classes("t-quiet")
            ui.space()
            if len(tuning.graph.alike(name)) > 1:
                every = ui.switch("every use", value=tuning.every)
                every.props("dense data-testid=every").bind_value(tuning, "every")
                every.tooltip("what changes here changes in every use of the group")
            ui.select(
                [FILE_BACKEND, "numpy", *["opencl"] * node.has_kernel],
                value=entry.backend or FILE_BACKEND,
                on_change=lambda e: self._do(
                    tuning.set_backend, name, None if e.value == FILE_BACKEND else e.value
                ),
            ).props("dense options-dense borderless data-testid=backend")
            if node.neutral is not None:
                ui.switch(
                    "neutral",
                    value=entry.neutral,
                    on_change=lambda e: self._do(tuning.set_neutral, name, e.value),
                ).props("dense data-testid=neutral")
            ui.button(icon="restart_alt", on_click=lambda: self._reset(name)).props(
                "flat dense round size=sm data-testid=reset"
            ).tooltip("as in the file")

    def _parameter(self, node: str, name: str, about: str) -> None:
        """A control, or the graph's param that gives the value, with a line of help."""
        value, entry = self._tuning.settings(node)[name], self._tuning.graph.nodes[node]
        stated = entry.settings.get(name)
        with ui.row().classes("w-full items-center gap-3 no-wrap"):
            ui.label(name).classes("t-name").style("width: 118px; flex: none")
            if isinstance(stated, str) and stated.startswith("$"):
                ui.label(f"{stated} = {value}").classes("t-help")
            else:
                self._control(node, entry.op, name, value)
        ui.label(about).classes("t-help").style("margin-top: -6px")

    def _control(self, node: str, op: str, name: str, value: Any) -> None:
        """A list, a switch, or a field, with a slider if the value has a range."""
        declared = getattr(nodes, op).parameters[name]
        control = control_of(declared.type, declared.limits, declared.default, value)
        # Set one by one: in a text of properties a value's quotes would end it.
        mark = {"data-testid": f"param-{name}"}
        if control.kind == "choice":
            choice = ui.select(
                list(control.choices),
                value=value,
                on_change=lambda e: self._set(node, name, e.value),
            )
            choice.props("dense options-dense").props.update(mark)
        elif control.kind == "flag":
            flag = ui.switch(value=value, on_change=lambda e: self._set(node, name, e.value))
            flag.props.update(mark)
        else:
            self._field(node, name, value, control, mark)

    def _field(
        self, node: str, name: str, value: Any, control: Control, mark: dict[str, str]
    ) -> None:
        if control.kind == "slider":
            slider = ui.element("input").classes("t-slider").props("type=range min=0 max=1000")
            slider.props.update(mark, value=str(round(control.place(value))))
        # Plain elements: NiceGUI's own send every value back, which a slider outruns.
        field = ui.element("input").classes("t-field")
        field.props.update({"data-testid": f"param-{name}-text", "value": _words(value)})
        if control.kind == "slider":

            def moved(event: events.GenericEventArguments) -> None:
                number = control.value(float(event.args))
                self._follow.value(field, _words(number))
                self._set(node, name, number)

            slider.on(
                "input",
                moved,
                throttle=SLIDER_INTERVAL_S,
                js_handler=f"{KEEP_TEXT_JS}; {EMIT_TEXT_JS} }}",
            )

        def typed(event: events.GenericEventArguments) -> None:
            text = str(event.args)
            self._do(
                lambda: self._tuning.set(node, name, text if "," in text else Document.scalar(text))
            )
            now = self._tuning.settings(node)[name]
            self._follow.value(field, _words(now))
            if control.kind == "slider":
                self._follow.value(slider, str(round(control.place(float(now)))))

        # Half-typed text must survive other updates of the page.
        field.on("input", js_handler=f"{KEEP_TEXT_JS} }}")
        field.on("change", typed, js_handler=f"(e) => {{ {EMIT_TEXT_JS} }}")

    def _set(self, node: str, name: str, value: Any) -> None:
        self._do(self._tuning.set, node, name, value)

    def _reset(self, node: str) -> None:
        self._do(self._tuning.reset, node)
        self.build()

    def _do(self, change: Callable[..., object], *words: Any) -> None:
        """Make a change that the panel already shows."""
        attempt(change, *words)
        self._shows = self._chosen()

    def _chosen(self) -> tuple[Graph, str | None, object]:
        """The state that the card is made of."""
        node = self._tuning.request.node
        return self._tuning.base, node, self._tuning.graph.nodes.get(node) if node else None


class _Inside:
    """An output of a node: a picture with its scale, or its value in words."""

    def __init__(self, tuning: Tuning, follow: Follow, name: str, ports: list[str]) -> None:
        self._name = name
        self._port = ""
        self._values: Mapping[str, Any] = {}
        self._ports = ui.toggle(ports, value=ports[0])
        self._ports.props("dense no-caps unelevated size=sm data-testid=ports")
        self._ports.on_value_change(lambda: self.draw(tuning.state))
        inside = ui.element("div").classes("t-inside w-full")
        with inside, ui.row().classes("w-full gap-2 no-wrap items-stretch"):
            self._picture = ScaledPicture(follow, "inside")
        self._picture.add_value("inside-value")
        self._text = ui.label().classes("t-help").style("white-space: pre-line")
        self._text.props("data-testid=inside-text")
        ui.separator()

    def draw(self, state: State) -> None:
        """Draw the chosen port, unless it is drawn already."""
        port = str(self._ports.value)
        if state.result is None or self._name not in state.result.plan.tasks:
            return
        plan = state.result.plan
        if port == self._port and state.inspected is self._values:
            return
        self._port, self._values = port, state.inspected
        declared, value = plan.tasks[self._name].node.outputs[port], state.inspected.get(port)
        planes = planes_of(declared.dims, value)
        self._picture.set_visibility(bool(planes))
        if planes:
            side = planes[0] if len(planes) == 1 else np.concatenate(planes[:MAX_PLANES], axis=1)
            self._picture.show(draw(side, declared.unit), "", height_vh=26)
        took = state.result.times.get(self._name, 0.0)
        where = plan.placements[self._name]
        head = f"{declared} · {took:.2f} ms on {where.backend} ({where.why})"
        self._text.set_text(head if planes else f"{head}\n{_described(value)}")


def _described(value: Any) -> str:
    """A value that is no picture, in words."""
    if isinstance(value, dict):
        return "\n".join(f"{k}: {v}" for k, v in list(value.items())[:MAX_ENTRIES])
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {' x '.join(map(str, value.shape))}: {value.ravel()[:6]}"
    return "not there for this item" if value is None else str(value)[:200]


def _words(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    return ",".join(map(str, value)) if isinstance(value, tuple | list) else str(value)
