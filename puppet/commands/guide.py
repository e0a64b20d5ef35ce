"""Guiding a person through steps, in a terminal or a log."""

from __future__ import annotations

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn


class Guide:
    """Says sentences on stderr, and how far something is; in a log, each sentence once."""

    def __init__(self) -> None:
        self._console = Console(stderr=True, soft_wrap=True)
        self._progress: Progress | None = None
        self._task: TaskID | None = None
        self._saying = ""

    def step(self, number: int, title: str) -> None:
        """Begin a step."""
        self.progress("", None)
        self._console.print(f"{number}. {title}", style="bold", markup=False, highlight=False)

    def say(self, text: str) -> None:
        """Say a sentence."""
        self._console.print(f"   {text}", markup=False, highlight=False)

    def warn(self, text: str) -> None:
        """Say what is wrong but can be lived with."""
        self._console.print(f"   {text}", style="yellow", markup=False, highlight=False)

    def progress(self, saying: str, share: float | None) -> None:
        """Say what goes on and how far it is, 0..1; None ends it."""
        if share is None:
            if self._progress is not None:
                self._progress.stop()
            self._progress = None
            self._saying = ""
            return
        if not self._console.is_terminal:
            if saying != self._saying:
                self.say(saying)
            self._saying = saying
            return
        if self._progress is None:
            self._progress = Progress(
                TextColumn("   {task.description}"),
                BarColumn(bar_width=24),
                console=self._console,
                transient=True,
            )
            self._task = self._progress.add_task(saying, total=1.0)
            self._progress.start()
        assert self._task is not None
        self._progress.update(self._task, description=saying, completed=share)
