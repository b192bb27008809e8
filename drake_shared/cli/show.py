"""``drake-shared show``: logs and demonstrations on a page."""

from __future__ import annotations

import dataclasses
import webbrowser
from pathlib import Path
from typing import Annotated

import tyro

from drake_shared.cli.command import Command, OptionalPath
from drake_shared.common.console import say
from drake_shared.common.errors import InputError
from drake_shared.common.files import check_target


@dataclasses.dataclass(kw_only=True)
class Show(Command):
    """Shows logs and demonstrations in the browser: paths, commands, weight and confidence over time, and
    figures, of one or of several laid over each other."""

    path: Annotated[Path, tyro.conf.Positional]
    """Folder of logs and demonstrations, or one file."""
    out: OptionalPath = None
    """Write a stand-alone HTML file here in place of opening the browser."""
    port: int = 0
    """Port on this machine to serve the page on; 0 takes any that is free."""
    open: bool = True
    """Open the page in this machine's browser."""

    def run(self) -> None:
        """Runs the command."""
        from drake_shared.analysis.viewer import Catalogue, Viewer, write_page

        catalogue = Catalogue(self.path)
        if self.out is not None:
            check_target(self.out)
            embedded = write_page(catalogue, self.out)
            total = len(catalogue.entries)
            rest = "" if embedded == total else f", of which it holds the curves of the first {embedded}"
            say(f"wrote {self.out}: {total} trials and demonstrations{rest}")
            return
        try:
            viewer = Viewer(catalogue, port=self.port)
        except OSError as error:
            raise InputError(
                "--port", "", f"must be free on this machine ({error.strerror})", self.port
            ) from error
        except OverflowError as error:
            raise InputError("--port", "", "must be from 0 to 65535", self.port) from error
        print(viewer.address, flush=True)
        say("Press Ctrl-C to end.")
        if self.open:
            webbrowser.open(viewer.address)
        viewer.serve()
