"""The dialog that saves a variant."""

from pathlib import Path

from nicegui import ui

from tactograph.graph.tune.attempt import attempt
from tactograph.graph.tune.tuning import Tuning

SAVE_LABEL, REPLACE_LABEL = "Save", "Replace it"


def ask_where_to_save(tuning: Tuning) -> None:
    """Ask for a file and write the variant there; another's file only after a confirmation."""
    with ui.dialog() as dialog, ui.card().style("min-width: 420px"):
        ui.label("Save as a variant").classes("t-title")
        field = ui.input("file", value=f"{tuning.base.name}_tuned.yaml")
        field.classes("w-full").props("data-testid=file")
        ui.label("extends the graph and holds what differs from it").classes("t-help")
        doubt = ui.label().classes("t-error").props("data-testid=doubt")
        doubt.set_visibility(False)

        def save() -> None:
            file, is_sure = Path(str(field.value)), button.text == REPLACE_LABEL
            if tuning.is_of_others(file) and not is_sure:
                doubt.set_text(f"{file} is there already, and was not saved here")
                ask(REPLACE_LABEL)
            elif attempt(lambda: tuning.save(file, over_others=is_sure)):
                dialog.close()
                ui.notify(f"saved and checked: {file}", type="positive")

        def ask(words: str) -> None:
            button.set_text(words)
            doubt.set_visibility(words == REPLACE_LABEL)

        field.on_value_change(lambda: ask(SAVE_LABEL))
        with ui.row().classes("w-full justify-end"):
            ui.button("Cancel", on_click=dialog.close).props("flat no-caps")
            button = ui.button(SAVE_LABEL, on_click=save)
            button.props("unelevated no-caps data-testid=write")
    dialog.open()
