"""The web page on which a person drives: server, page, driver lock, and trials in real time."""

from drake_shared.cockpit.drive import drive, open_session
from drake_shared.cockpit.driver_lock import DriverLock
from drake_shared.cockpit.server import CockpitServer
from drake_shared.cockpit.session import Session

__all__ = ["CockpitServer", "DriverLock", "Session", "drive", "open_session"]
