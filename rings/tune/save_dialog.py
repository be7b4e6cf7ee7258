"""The dialog that saves a variant."""

from pathlib import Path

from nicegui import ui

from tactograph.rings.tune.attempt import attempt
from tactograph.rings.tune.tuning import Tuning


def ask_where_to_save(tuning: Tuning) -> None:
    """Ask for a file, and write the variant there."""
    with ui.dialog() as dialog, ui.card().style("min-width: 420px"):
        ui.label("Save as a variant").classes("t-title")
        field = ui.input("file", value=f"{tuning.base.name}_tuned.yaml")
        field.classes("w-full").props("data-testid=file")
        ui.label("extends the graph and holds what differs from it").classes("t-help")

        def save() -> None:
            file = Path(str(field.value))
            if attempt(tuning.save, file):
                dialog.close()
                ui.notify(f"saved and checked: {file}", type="positive")

        with ui.row().classes("w-full justify-end"):
            ui.button("Cancel", on_click=dialog.close).props("flat no-caps")
            button = ui.button("Save", on_click=save)
            button.props("unelevated no-caps data-testid=write")
    dialog.open()
