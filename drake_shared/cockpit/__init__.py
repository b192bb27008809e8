"""The web page on which a person drives: server, page, driver's seat, and trials in real time."""

from drake_shared.cockpit.drive import drive, open_session
from drake_shared.cockpit.seat import Seat
from drake_shared.cockpit.server import CockpitServer
from drake_shared.cockpit.session import Session

__all__ = ["CockpitServer", "Seat", "Session", "drive", "open_session"]
