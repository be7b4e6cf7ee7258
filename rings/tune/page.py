"""The page: the graph as a drawing, a node's controls and outputs, and the result."""

from html import escape
from importlib import resources

from nicegui import app, ui

from tactograph.rings.tune.follow import Follow
from tactograph.rings.tune.graph_view import GraphView
from tactograph.rings.tune.guard import Guard
from tactograph.rings.tune.node_panel import NodePanel
from tactograph.rings.tune.result_view import ResultView
from tactograph.rings.tune.save_dialog import ask_where_to_save
from tactograph.rings.tune.tuning import State, Tuning
from tactograph.sdk import Result

POLL_INTERVAL_S = 0.025
"""Time between two looks for a new result."""
DRAW_INTERVAL_S = 0.5
"""Time between two looks at the file, and between two drawings with new times."""
MAX_FIGURES = 4


def serve(tuning: Tuning, *, port: int, token: str, show: bool) -> None:
    """Serve the page to this machine until it is stopped."""
    app.add_middleware(Guard, token=token, port=port)
    app.on_shutdown(tuning.close)
    ui.run(
        lambda: Page(tuning),
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


class Page:
    """The page in one browser; its state is that of `Tuning`, shared by all browsers."""

    def __init__(self, tuning: Tuning) -> None:
        self.tuning = tuning
        self._shown_number = -1
        css = (resources.files("tactograph.rings.tune") / "page.css").read_text(encoding="utf-8")
        ui.add_css(css)
        self._follow = Follow(ui.context.client)
        ui.colors(primary="#1f5fa8", accent="#d1495b")
        self._head()
        self._error = ui.label().classes("t-error").props("data-testid=error")
        self._error.set_visibility(False)
        with ui.column().classes("w-full gap-3 q-pa-sm"):
            self._graph = GraphView(tuning, self.choose)
            with ui.row().classes("w-full gap-3 no-wrap items-start"):
                self._result = ResultView(tuning, self._follow)
                self._panel = NodePanel(tuning, self._follow)
        ui.timer(POLL_INTERVAL_S, self._look)
        ui.timer(DRAW_INTERVAL_S, self.take_up_late)

    def choose(self, name: str) -> None:
        """Look at a node, if there is one of that name."""
        if name in self.tuning.graph.nodes:
            self.tuning.look_at(name)
            self._panel.build()
            self._graph.draw()

    def take_up(self, state: State) -> None:
        """Show a result, or an error."""
        self._shown_number = state.number
        self._error.set_text(state.error)
        self._error.set_visibility(bool(state.error))
        if state.result is None:
            return
        if self._graph.drawn < 0:
            self._graph.draw()
        self._tell(state.result)
        self._result.draw()
        self._panel.draw(state)

    def take_up_late(self) -> None:
        """Take up slow changes: the file and, where the hand rests, the drawing's times."""
        self.tuning.reload()
        self._follow_others()
        state = self.tuning.state
        if state.request is not None and self._graph.drawn != state.number:
            self._graph.draw()

    def _head(self) -> None:
        tuning = self.tuning
        with ui.row().classes("t-head items-center gap-4 no-wrap"):
            with ui.column().classes("gap-0"):
                ui.label(tuning.base.name).classes("t-brand")
                self._about = ui.html("", sanitize=False).classes("t-quiet")
            with ui.row().classes("items-center gap-1 no-wrap"):
                back = ui.button(icon="chevron_left", on_click=lambda: tuning.go(-1))
                back.props("flat dense round color=white data-testid=previous")
                back.set_visibility(bool(tuning.captures))
                self._where = ui.html("", sanitize=False)
                self._where.style("min-width: 90px; text-align: center")
                self._where.props("data-testid=capture")
                ui.button(icon="chevron_right", on_click=lambda: tuning.go(1)).props(
                    "flat dense round color=white data-testid=next"
                )
                if not tuning.captures:
                    self._playing = ui.button(icon="play_arrow", on_click=self._play)
                    self._playing.props("flat dense round color=white data-testid=play")
            ui.space()
            self._figures = ui.html("", sanitize=False).classes("row no-wrap")
            self._figures.props("data-testid=figures")
            ui.button("Save", icon="save", on_click=lambda: ask_where_to_save(tuning)).props(
                "unelevated dense no-caps data-testid=save"
            ).style("padding: 4px 12px")

    async def _look(self) -> None:
        """Take up a new result; without one, a call costs nothing."""
        if self.tuning.state.number != self._shown_number:
            self.take_up(self.tuning.state)
        await self._follow.send()

    def _tell(self, result: Result) -> None:
        tuning = self.tuning
        changes = len(tuning.changes())
        changed = f"{changes} change{'s' if changes != 1 else ''}" if changes else "as in the file"
        self._follow.html(self._about, f"{tuning.graph.hash} · {changed}")
        place = tuning.capture
        where = escape(place.name) if place else f"item {tuning.request.item + 1}"
        self._follow.html(self._where, where)
        figures = [
            (name.replace("_", " "), f"{figure:.3g}")
            for name, figure in result.figures.items()
            if "/" not in name and isinstance(figure, int | float)
        ]
        speed = [("ms", f"{result.total:.0f}"), ("updates/s", f"{len(tuning.rates)}")]
        cells = (
            f'<div class="t-figure"><b>{escape(text)}</b><span>{escape(name)}</span></div>'
            for name, text in (*speed, *figures[:MAX_FIGURES])
        )
        self._follow.html(self._figures, "".join(cells))

    def _play(self) -> None:
        self.tuning.play(not self.tuning.playing)
        self._follow_others()

    def _follow_others(self) -> None:
        """Take up changes by the file, another browser or the stream's end."""
        self._panel.follow_others()
        if not self.tuning.captures:
            self._playing.set_icon("pause" if self.tuning.playing else "play_arrow")
