"""The page: the graph as a drawing, a node's controls and outputs, and the result.

Long because it is one page: its parts share what is chosen, shown and drawn.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from html import escape
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from nicegui import app, events, ui
from numpy.typing import NDArray

from tactograph.graph.declare.find_node import find_node
from tactograph.graph.declare.node import Node
from tactograph.graph.declare.node_page import describe, range_of
from tactograph.graph.disk.strict_yaml import parse_scalar
from tactograph.graph.errors import TactographError
from tactograph.graph.files.flat_graph import Entry, Graph
from tactograph.graph.files.groups import alike
from tactograph.graph.files.read_graph import shipped_names
from tactograph.graph.plan.sketch import sketch_of
from tactograph.graph.run.result import Result
from tactograph.graph.show.draw_svg import to_svg
from tactograph.graph.show.draw_text import COLOURS
from tactograph.graph.show.views import kind_of
from tactograph.graph.tune.controls import Control, control_of
from tactograph.graph.tune.follow import Follow
from tactograph.graph.tune.guard import Guard
from tactograph.graph.tune.picture_view import PictureView, Pointed
from tactograph.graph.tune.pictures import Picture, draw, draw_difference, gradient, planes_of
from tactograph.graph.tune.tuning import Shown, Tuning

LOOK_EVERY_S = 0.025
"""How often the page asks whether there is something new."""
SLIDE_EVERY_S = 0.02
"""How often a slider that is drawn says where it is; NiceGUI's own does so 20 times a second."""
DRAW_EVERY_S = 0.5
"""How often the drawing takes up new times, and the file is looked at."""
REPLACE = "Replace it"
VIEWS = ("result", "beside", "wipe", "difference")
AS_FILE = "as the graph says"
LINES = ("#1f5fa8", "#d1495b")
KEEP = "(e) => { Vue.toRaw(element).props.value = e.target.value"
TELL = "emit(e.target.value)"


def serve(tuning: Tuning, *, port: int, token: str, show: bool) -> None:
    """Serve the page to this machine until it is stopped."""
    app.add_middleware(Guard, token=token, port=port)
    app.on_shutdown(tuning.close)
    ui.run(
        lambda: _Page(tuning),
        host="127.0.0.1",
        port=port,
        title=f"{tuning.base.name} · tactograph tune",
        show=f"/?token={token}" if show else False,
        reload=False,
        show_welcome_message=False,
        tailwind=False,  # a script that looks through the whole page at every change
        fastapi_docs=False,
        uvicorn_logging_level="critical",
    )


class _Page:
    """What one browser sees; the state is that of `Tuning`, the same for all."""

    def __init__(self, tuning: Tuning) -> None:
        self.tuning = tuning
        self.seen = -1
        self.drawn = -1
        self.panel_shows: tuple[Graph, str | None, Entry | None] | None = None
        self.output = ""
        self.view = "result"
        self.row = self.column = 0.5
        self.picture: Picture | None = None
        self.inside: Picture | None = None
        self.inside_of = ("", "")
        self.inside_values: Mapping[str, Any] = {}
        self.port = ""
        css = (resources.files("tactograph.graph.tune") / "page.css").read_text(encoding="utf-8")
        ui.add_css(css)
        self.follow = Follow(ui.context.client)
        ui.colors(primary="#1f5fa8", accent="#d1495b")
        self._head()
        self.error = ui.label().classes("t-error").props("data-testid=error")
        self.error.set_visibility(False)
        with ui.column().classes("w-full gap-3 q-pa-sm"):
            self._graph()
            with ui.row().classes("w-full gap-3 no-wrap items-start"):
                self._result()
                self.panel = ui.column().classes("t-card gap-2").style("width: 43%; min-width: 0")
        self._node_panel()
        ui.timer(LOOK_EVERY_S, self._look)
        ui.timer(DRAW_EVERY_S, self._seldom)

    def _head(self) -> None:
        tuning = self.tuning
        with ui.row().classes("t-head items-center gap-4 no-wrap"):
            with ui.column().classes("gap-0"):
                ui.label(tuning.base.name).classes("t-brand")
                self.about = ui.html("", sanitize=False).classes("t-quiet")
            with ui.row().classes("items-center gap-1 no-wrap"):
                back = ui.button(icon="chevron_left", on_click=lambda: self._go(-1))
                back.props("flat dense round color=white data-testid=previous")
                back.set_visibility(bool(tuning.captures))
                self.where = ui.html("", sanitize=False)
                self.where.style("min-width: 90px; text-align: center")
                self.where.props("data-testid=capture")
                ui.button(icon="chevron_right", on_click=lambda: self._go(1)).props(
                    "flat dense round color=white data-testid=next"
                )
                if not tuning.captures:
                    self.playing = ui.button(icon="play_arrow", on_click=self._play)
                    self.playing.props("flat dense round color=white data-testid=play")
            ui.space()
            self.figures = ui.html("", sanitize=False).classes("row no-wrap")
            self.figures.props("data-testid=figures")
            beside = {"": "no graph beside", **{name: name for name in shipped_names()}}
            now = tuning.asked.beside
            if now is not None:
                beside.setdefault(now.name, now.name)
            self.beside = ui.select(beside, value=now.name if now else "", on_change=self._beside)
            self.beside.props("dark dense options-dense borderless data-testid=beside")
            self.beside.style("min-width: 150px")
            ui.button("Save", icon="save", on_click=self._ask_name).props(
                "unelevated dense no-caps data-testid=save"
            ).style("padding: 4px 12px")

    def _graph(self) -> None:
        with ui.column().classes("t-card w-full gap-1"):
            with ui.row().classes("w-full items-center gap-3 no-wrap"):
                ui.label("Graph").classes("t-title")
                for backend, colour in COLOURS.items():
                    ui.label(backend).classes("t-backend").style(f"background: {colour}")
                ui.label("click a node").classes("t-help")
                ui.space()
                self.finder = (
                    ui.select([], label="find a node", with_input=True, on_change=self._found)
                    .props("dense options-dense borderless data-testid=find")
                    .style("width: 200px")
                )
                ui.icon("zoom_in").classes("text-grey")
                self.zoom = ui.slider(min=20, max=120, value=62, on_change=self._draw_graph)
                self.zoom.style("width: 110px")
            self.drawing = ui.html("", sanitize=False).classes("t-graph")
            self.drawing.props("data-testid=graph")
            pick = (
                "(e) => { const g = e.target.closest('[data-node]'); if (g) emit(g.dataset.node) }"
            )
            self.drawing.on("click", lambda e: self._choose(e.args), js_handler=pick)

    def _result(self) -> None:
        with ui.column().classes("t-card gap-2").style("width: 57%; min-width: 0"):
            with ui.row().classes("w-full items-center gap-3 no-wrap"):
                self.outputs = ui.select([], on_change=self._output_chosen)
                self.outputs.props("dense options-dense borderless data-testid=output")
                ui.space()
                self.views = ui.toggle(
                    {view: view for view in VIEWS}, value=self.view, on_change=self._view_chosen
                ).props("dense no-caps unelevated data-testid=view")
            with ui.row().classes("w-full gap-2 no-wrap items-stretch"):
                self.image = PictureView(self._over_result).props("data-testid=picture")
                self.bar = ui.element("div").classes("t-bar")
                self.scale = ui.html("", sanitize=False).classes("t-scale")
                with ui.column().classes("gap-1").style("flex: 1 1 150px; min-width: 150px"):
                    self.under = ui.html("", sanitize=False).classes("t-under")
                    self.under.props("data-testid=value")
                    self.section = ui.html("", sanitize=False).classes("t-section w-full")
                    self.section.props("data-testid=section")

    async def _look(self) -> None:
        """Take up what is new; called often, it costs nothing where there is nothing."""
        if self.tuning.shown.number != self.seen:
            self._take_up(self.tuning.shown)
        await self.follow.send()

    def _take_up(self, shown: Shown) -> None:
        self.seen = shown.number
        self.error.set_text(shown.error)
        self.error.set_visibility(bool(shown.error))
        if shown.result is None or shown.plan is None:
            return
        if self.drawn < 0:
            self._draw_graph()
        self._tell(shown.result)
        self._draw_result()
        self._draw_inside(shown)

    def _tell(self, result: Result) -> None:
        tuning = self.tuning
        changes = len(tuning.changes())
        changed = f"{changes} change{'s' if changes != 1 else ''}" if changes else "as in the file"
        self.follow.html(self.about, f"{tuning.graph.hash} · {changed}")
        place = tuning.capture
        where = escape(place.name) if place else f"item {tuning.asked.item + 1}"
        self.follow.html(self.where, where)
        figures = [
            (name, figure)
            for value in result.outputs.values()
            if isinstance(value, dict)
            for name, figure in value.items()
            if "/" not in name and isinstance(figure, int | float)
        ]
        shown_figures = [("ms", f"{result.total:.0f}"), ("updates/s", f"{len(tuning.rates)}")]
        shown_figures += [(name.replace("_", " "), f"{figure:.3g}") for name, figure in figures[:4]]
        cells = (
            f'<div class="t-figure"><b>{escape(text)}</b><span>{escape(name)}</span></div>'
            for name, text in shown_figures
        )
        self.follow.html(self.figures, "".join(cells))

    def _draw_graph(self) -> None:
        shown = self.tuning.shown
        if shown.plan is None or shown.result is None:
            return
        self.drawn = shown.number
        if not self.finder.options:
            self.finder.set_options(sorted(shown.plan.tasks))
        svg = to_svg(sketch_of(shown.plan), shown.result.times)
        zoom = float(self.zoom.value) / 100
        head, _, rest = svg.partition(">")
        width, height = (
            float(head.split(f'{side}="')[1].split('"')[0]) for side in ("width", "height")
        )
        head = head.replace(f'width="{width:g}"', "").replace(f'height="{height}"', "")
        style = f' style="width:{width * zoom:.0f}px;height:{height * zoom:.0f}px"'
        chosen = self.tuning.asked.node
        mark = (
            f'<style>[data-node="{chosen}"] rect{{stroke:#d1495b;stroke-width:3}}</style>'
            if chosen
            else ""
        )
        self.drawing.set_content(f"{head}{style}>{mark}{rest}")

    def _draw_result(self) -> None:
        shown = self.tuning.shown
        if shown.result is None:
            return
        names = [
            name
            for name, array in shown.result.items()
            if self._plane(shown.result, name) is not None
        ]
        if names and self.outputs.options != names:
            self.outputs.set_options(names, value=self.output if self.output in names else names[0])
            self.output = self.outputs.value
            self.tuning.output = self.output
        if not self.output:
            return
        mine = self._plane(shown.result, self.output)
        other = self._plane(shown.beside, self.output) if shown.beside is not None else None
        if mine is None:
            return
        unit = shown.result.plan.port(self.output).unit
        if other is not None and other.shape != mine.shape:
            other = None
        self.picture = picture = self._composed(mine, other, unit)
        width, height = picture.size
        row, column = int(self.row * (height - 1)), int(self.column * (width - 1))
        dashed = f'x1="0" x2="{width}" y1="{row}" y2="{row}" stroke-dasharray="6 4"'
        line = f'<line {dashed} stroke="white"/>'
        if self.view == "wipe":
            line += f'<line x1="{column}" x2="{column}" y2="{height}" stroke="white"/>'
        self.follow.picture(self.image, picture.uri, picture.size, line)
        self.image.style(f"max-width: calc(42vh * {width / height:.3f})")
        self._draw_scale(picture, self.bar, self.scale)
        lines = [mine[row], *([other[row]] if other is not None else [])]
        self.follow.html(self.section, _section_svg(lines, unit, row))

    def _composed(self, mine: NDArray[Any], other: NDArray[Any] | None, unit: str) -> Picture:
        """The picture of the chosen view; that of the result where there is nothing beside."""
        if other is None or self.view == "result":
            return draw(mine, unit)
        if self.view == "beside":
            return draw(other, unit)
        if self.view == "difference" and mine.dtype.kind == "f":
            return draw_difference(mine - other, unit)
        joined = mine.copy()
        column = int(self.column * (mine.shape[1] - 1))
        joined[:, column:] = other[:, column:]
        return draw(joined, unit)

    def _over_result(self, mouse: Pointed) -> None:
        picture = self.picture
        if picture is None:
            return
        self.follow.html(self.under, escape(_under(picture, mouse)))
        if mouse.pressed:
            width, height = picture.size
            self.column = min(max(mouse.x / max(width - 1, 1), 0.0), 1.0)
            self.row = min(max(mouse.y / max(height - 1, 1), 0.0), 1.0)
            self._draw_result()

    def _draw_scale(self, picture: Picture, bar: ui.element, scale: ui.html) -> None:
        """The colour bar beside a picture, with its ends and its middle."""
        if picture.kind == "labels":
            self.follow.background(bar, "none")
            self.follow.html(scale, f"<span>{escape(picture.unit)}</span>")
            return
        colours = "RdBu_r" if picture.kind == "difference" else "viridis"
        self.follow.background(bar, f"linear-gradient(to top, {gradient(colours)})")
        middle = (picture.low + picture.high) / 2
        marks = (f"{picture.high:.4g} {picture.unit}", f"{middle:.4g}", f"{picture.low:.4g}")
        self.follow.html(scale, "".join(f"<span>{escape(mark)}</span>" for mark in marks))

    def _node_panel(self) -> None:
        """Everything about the chosen node, made anew when another is chosen."""
        tuning, name = self.tuning, self.tuning.asked.node
        self.panel_shows = self._chosen()
        self.panel.clear()
        self.inside, self.inside_of = None, ("", "")
        with self.panel:
            if name is None or name not in tuning.graph.nodes:
                ui.label("A node").classes("t-title")
                ui.label(
                    "Click one in the graph: here are then its parameters, its back end, "
                    "what it does and what it makes."
                ).classes("t-help")
                return
            entry = tuning.graph.nodes[name]
            node = find_node(entry.op)
            about = describe(node)
            with ui.row().classes("w-full items-center gap-2 no-wrap"):
                ui.label(name).classes("t-name").props("data-testid=node")
                ui.label(entry.op).classes("t-quiet")
                ui.space()
                if len(alike(tuning.graph, name)) > 1:
                    every = ui.switch("every use", value=tuning.every)
                    every.props("dense data-testid=every").bind_value(tuning, "every")
                    every.tooltip("what changes here changes in every use of the group")
                backends = [AS_FILE, *sorted(node.backends)]
                ui.select(
                    backends,
                    value=entry.backend or AS_FILE,
                    on_change=lambda e: self._do(
                        tuning.set_backend, name, None if e.value == AS_FILE else e.value
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
            ui.label(about.summary.replace("``", "")).classes("t-help")
            if about.text:
                with ui.expansion("more").props("dense dense-toggle").classes("t-more w-full"):
                    ui.label(about.text.replace("``", "")).style("white-space: pre-line")
            if node.outputs:
                self._outputs_of(node)
            for parameter in node.parameters.values():
                value = tuning.settings(name)[parameter.name]
                said = entry.settings.get(parameter.name)
                fixed = isinstance(said, str) and said.startswith("$")
                with ui.row().classes("w-full items-center gap-3 no-wrap"):
                    ui.label(parameter.name).classes("t-name").style("width: 118px; flex: none")
                    if fixed:
                        ui.label(f"{said} = {value}").classes("t-help")
                    else:
                        self._control(name, parameter.name, control_of(parameter, value), value)
                said_of = (about.arguments[parameter.name].replace("``", ""), range_of(parameter))
                help_text = " · ".join(filter(None, said_of))
                ui.label(help_text).classes("t-help").style("margin-top: -6px")

    def _outputs_of(self, node: Node) -> None:
        """What a node makes: a picture with its scale, and the value under the cursor."""
        ports = [*node.outputs]
        self.ports = ui.toggle(ports, value=ports[0])
        self.ports.props("dense no-caps unelevated size=sm data-testid=ports")
        self.ports.on_value_change(lambda: self._draw_inside(self.tuning.shown))
        inside = ui.element("div").classes("t-inside w-full")
        with inside, ui.row().classes("w-full gap-2 no-wrap items-stretch"):
            self.inside_picture = PictureView(self._over_inside).props("data-testid=inside")
            self.inside_bar = ui.element("div").classes("t-bar")
            self.inside_scale = ui.html("", sanitize=False).classes("t-scale")
        self.inside_under = ui.html("", sanitize=False).classes("t-under")
        self.inside_under.props("data-testid=inside-value")
        self.inside_text = ui.label().classes("t-help").style("white-space: pre-line")
        self.inside_text.props("data-testid=inside-text")
        ui.separator()

    def _control(self, node: str, name: str, control: Control, value: Any) -> None:
        # Set one by one: in a text of properties a value's quotes would end it.
        mark = {"data-testid": f"param-{name}"}
        if control.kind == "choice":
            choice = ui.select(
                list(control.choices),
                value=value,
                on_change=lambda e: self._set(node, name, e.value),
            )
            choice.props("dense options-dense").props.update(mark)
            return
        if control.kind == "flag":
            flag = ui.switch(value=value, on_change=lambda e: self._set(node, name, e.value))
            flag.props.update(mark)
            return
        if control.kind == "slider":
            slider = ui.element("input").classes("t-slider").props("type=range min=0 max=1000")
            slider.props.update(mark, value=str(round(control.place(value))))
        # Plain elements: NiceGUI's own send every value back, which a slider outruns.
        field = ui.element("input").classes("t-field")
        field.props.update({"data-testid": f"param-{name}-text", "value": _words(value)})
        if control.kind == "slider":

            def moved(event: events.GenericEventArguments) -> None:
                found = control.value(float(event.args))
                self.follow.value(field, _words(found))
                self._set(node, name, found)

            slider.on("input", moved, throttle=SLIDE_EVERY_S, js_handler=f"{KEEP}; {TELL} }}")

        def typed(event: events.GenericEventArguments) -> None:
            text = str(event.args)
            self._do(
                lambda: self.tuning.set(node, name, parse_scalar(text) if "," not in text else text)
            )
            now = self.tuning.settings(node)[name]
            self.follow.value(field, _words(now))
            if control.kind == "slider":
                self.follow.value(slider, str(round(control.place(float(now)))))

        # What is half typed must outlast the page's other updates.
        field.on("input", js_handler=f"{KEEP} }}")
        field.on("change", typed, js_handler=f"(e) => {{ {TELL} }}")

    def _draw_inside(self, shown: Shown) -> None:
        name = self.tuning.asked.node
        if name is None or shown.plan is None or (shown.asked and shown.asked.node != name):
            return
        if self.panel_shows is None or self.panel_shows[1] != name:
            return  # another browser has chosen it: the panel follows
        task = shown.plan.tasks.get(name)
        if task is None or not task.node.outputs or not hasattr(self, "inside_picture"):
            return
        port = str(self.ports.value)
        if self.inside_of == (name, port) and self.inside_values is shown.inspected:
            return
        self.inside_of, self.inside_values = (name, port), shown.inspected
        value, declared = shown.inspected.get(port), task.node.outputs[port]
        planes = planes_of(declared, value)
        took = shown.result.times.get(name, 0.0) if shown.result is not None else 0.0
        where = shown.plan.placements[name]
        said = f"{declared} · {took:.2f} ms on {where.backend} ({where.why})"
        for part in (self.inside_picture, self.inside_bar, self.inside_scale):
            part.set_visibility(bool(planes))
        if planes:
            side = planes[0] if len(planes) == 1 else np.concatenate(planes[:4], axis=1)
            self.inside = draw(side, declared.unit)
            self.follow.picture(self.inside_picture, self.inside.uri, self.inside.size, "")
            width, height = self.inside.size
            self.inside_picture.style(f"max-width: calc(26vh * {width / height:.3f})")
            self._draw_scale(self.inside, self.inside_bar, self.inside_scale)
        elif isinstance(value, dict):
            said += "\n" + "\n".join(f"{k}: {v}" for k, v in list(value.items())[:30])
        elif isinstance(value, np.ndarray):
            said += f"\n{value.dtype} {' x '.join(map(str, value.shape))}: {value.ravel()[:6]}"
        elif value is not None:
            said += f"\n{str(value)[:200]}"
        else:
            said += "\nnot there for this item"
        self.inside_text.set_text(said)

    def _over_inside(self, mouse: Pointed) -> None:
        if self.inside is not None:
            self.follow.html(self.inside_under, escape(_under(self.inside, mouse)))

    def _chosen(self) -> tuple[Graph, str | None, Entry | None]:
        """What the panel is made of."""
        node = self.tuning.asked.node
        return self.tuning.base, node, self.tuning.graph.nodes.get(node) if node else None

    def _choose(self, name: str) -> None:
        if name in self.tuning.graph.nodes:
            self.tuning.look_at(name)
            self._node_panel()
            self._draw_graph()

    def _found(self, event: events.ValueChangeEventArguments[Any]) -> None:
        if event.value:
            self._choose(str(event.value))

    def _set(self, node: str, name: str, value: Any) -> None:
        self._do(self.tuning.set, node, name, value)

    def _reset(self, node: str) -> None:
        self._do(self.tuning.reset, node)
        self._node_panel()

    def _go(self, steps: int) -> None:
        self.tuning.go(steps)

    def _play(self) -> None:
        self.tuning.play(not self.tuning.playing)
        self._follow_others()

    def _beside(self, event: events.ValueChangeEventArguments[Any]) -> None:
        if event.value != self._name_beside():
            self._do(self.tuning.put_beside, event.value or None)

    def _name_beside(self) -> str:
        beside = self.tuning.asked.beside
        return beside.name if beside is not None else ""

    def _output_chosen(self, event: events.ValueChangeEventArguments[Any]) -> None:
        self.output = self.tuning.output = event.value
        self._draw_result()

    def _view_chosen(self, event: events.ValueChangeEventArguments[Any]) -> None:
        self.view = event.value
        self._draw_result()

    def _do(self, change: Any, *words: Any) -> None:
        """Make a change; what is refused is told, and nothing has changed."""
        try:
            change(*words)
        except TactographError as error:
            ui.notify(" ".join(str(error).split()), type="negative", multi_line=True)
        self.panel_shows = self._chosen()

    def _seldom(self) -> None:
        """Take up what may come late: the file, and, where the hand rests, the drawing's times."""
        self.tuning.reload()
        self._follow_others()
        shown = self.tuning.shown
        if shown.asked is not None and self.drawn != shown.number:
            self._draw_graph()

    def _follow_others(self) -> None:
        """Take up what the file, another browser or the stream's end has changed."""
        now, shows = self._chosen(), self.panel_shows
        if shows is None or now[0] is not shows[0] or now != shows:
            self._node_panel()
        self.beside.set_value(self._name_beside())
        if not self.tuning.captures:
            self.playing.set_icon("pause" if self.tuning.playing else "play_arrow")

    def _ask_name(self) -> None:
        with ui.dialog() as dialog, ui.card().style("min-width: 420px"):
            ui.label("Save as a variant").classes("t-title")
            field = ui.input("file", value=f"{self.tuning.base.name}_tuned.yaml")
            field.classes("w-full").props("data-testid=file")
            ui.label("extends the graph and holds what differs from it").classes("t-help")
            doubt = ui.label().classes("t-error").props("data-testid=doubt")
            doubt.set_visibility(False)

            def save() -> None:
                file, is_sure = Path(str(field.value)), button.text == REPLACE
                if self.tuning.is_of_others(file) and not is_sure:
                    doubt.set_text(f"{file} is there already, and was not saved here")
                    ask(REPLACE)
                    return
                try:
                    self.tuning.save(file, over_others=is_sure)
                except TactographError as error:
                    ui.notify(" ".join(str(error).split()), type="negative", multi_line=True)
                    return
                dialog.close()
                ui.notify(f"saved and checked: {file}", type="positive")

            def ask(words: str) -> None:
                button.set_text(words)
                doubt.set_visibility(words == REPLACE)

            field.on_value_change(lambda: ask("Save"))
            with ui.row().classes("w-full justify-end"):
                ui.button("Cancel", on_click=dialog.close).props("flat no-caps")
                button = ui.button("Save", on_click=save)
                button.props("unelevated no-caps data-testid=write")
        dialog.open()

    def _plane(self, result: Result | None, name: str) -> NDArray[Any] | None:
        """An output as one plane, if it is one."""
        if result is None or name not in result.outputs:
            return None
        array = result.outputs[name]
        is_plane = kind_of(result.plan.port(name)) in ("map", "labels")
        return array if isinstance(array, np.ndarray) and is_plane else None


def _words(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    return ",".join(map(str, value)) if isinstance(value, tuple | list) else str(value)


def _under(picture: Picture, mouse: Pointed) -> str:
    """Place and value under the cursor."""
    height, width = picture.array.shape
    column, row = math.floor(mouse.x), math.floor(mouse.y)
    if not (0 <= column < width and 0 <= row < height):
        return ""
    value = picture.array[row, column]
    text = f"{value:.5g}" if picture.array.dtype.kind == "f" else f"{value}"
    return f"x {column}  y {row}   {text} {picture.unit}"


def _section_svg(lines: list[NDArray[Any]], unit: str, row: int) -> str:
    """One row of each result as a curve."""
    known = np.concatenate([line[np.isfinite(line)] for line in lines])
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    span = (high - low) or 1.0
    curves = []
    for colour, line in zip(LINES, lines, strict=False):
        step = max(1, line.size // 600)
        xs = np.arange(0, line.size, step) * (1000 / max(line.size - 1, 1))
        ys = 112 - 104 * (np.nan_to_num(line[::step].astype(float), nan=low) - low) / span
        points = " ".join(f"{x:.0f},{y:.1f}" for x, y in zip(xs, ys, strict=True))
        curves.append(
            f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.6" '
            'vector-effect="non-scaling-stroke"/>'
        )
    return (
        f'<div class="t-help">section along y = {row}, {low:.4g} to {high:.4g} {escape(unit)}; '
        "press in the picture and drag to move it</div>"
        '<svg viewBox="0 0 1000 120" preserveAspectRatio="none">'
        f'<rect width="1000" height="120" fill="#f7f8fa"/>{"".join(curves)}</svg>'
    )
