"""The graph on the page: a drawing in which nodes are chosen."""

from collections.abc import Callable

from nicegui import ui

from tactograph.rings.tune.tuning import Tuning

EMIT_NODE_JS = "(e) => { const g = e.target.closest('[data-node]'); if (g) emit(g.dataset.node) }"


class GraphView:
    """The card with the drawing, which has the times of the result number `drawn`; -1 for none."""

    def __init__(self, tuning: Tuning, choose: Callable[[str], None]) -> None:
        self._tuning, self._choose = tuning, choose
        self._opened: set[str] = set()
        self.drawn = -1
        with ui.column().classes("t-card w-full gap-1"):
            with ui.row().classes("w-full items-center gap-3 no-wrap"):
                ui.label("Graph").classes("t-title")
                ui.label("click a node, or a group to open it").classes("t-help")
                fold_all = ui.button("fold", on_click=self._fold).props("dense flat no-caps")
                fold_all.props("data-testid=fold")
                ui.space()
                self._finder = (
                    ui.select(
                        [],
                        label="find a node",
                        with_input=True,
                        on_change=lambda e: choose(str(e.value or "")),
                    )
                    .props("dense options-dense borderless data-testid=find")
                    .style("width: 200px")
                )
                ui.icon("zoom_in").classes("text-grey")
                zoom = ui.slider(min=0.2, max=1.2, step=0.01, value=0.62).style("width: 110px")
            self._drawing = ui.html("", sanitize=False).classes("t-graph")
            zoom.on_value_change(lambda e: self._drawing.style(f"--zoom: {e.value}"))
            self._drawing.props("data-testid=graph")
            self._drawing.on("click", lambda e: self._open(e.args), js_handler=EMIT_NODE_JS)

    def _open(self, name: str) -> None:
        """Open a group's use, or choose a node."""
        if name not in self._tuning.graph.uses:
            self._choose(name)
            return
        self._opened.add(name)
        self.draw()

    def _fold(self) -> None:
        self._opened.clear()
        self.draw()

    def draw(self) -> None:
        """Draw the plan with the times of the last result, and mark the chosen node."""
        state = self._tuning.state
        if state.result is None:
            return
        plan = state.result.plan
        self.drawn = state.number
        if not self._finder.options:
            self._finder.set_options(sorted(plan.tasks))
        chosen = self._tuning.request.node or ""
        self._opened |= {use for use in plan.graph.uses if chosen.startswith(f"{use}.")}
        svg = state.result.svg(self._opened)
        mark = f'<style>[data-node="{chosen}"] rect{{stroke:#d1495b;stroke-width:3}}</style>'
        self._drawing.set_content(f"{svg}{mark if chosen else ''}")
