"""The web page on which a person drives: server, page, driver lock, and trials in real time.

:func:`drive` does everything. :func:`open_session` does the same for an operator of your own. For a real
robot use the parts: a :class:`DriverLock` that a MouseInput reads, a :class:`CockpitServer` that serves the
page, and :func:`describe_scene` and :func:`describe_now` for its messages; see examples/real_robot_udp.py and
docs/websocket_protocol.md.
"""

from drake_shared.cockpit.drive import drive, open_session
from drake_shared.cockpit.driver_lock import DriverLock
from drake_shared.cockpit.meshcat_proxy import start_meshcat
from drake_shared.cockpit.page_state import describe_now, describe_scene
from drake_shared.cockpit.server import CockpitServer
from drake_shared.cockpit.session import Session

__all__ = [
    "CockpitServer",
    "DriverLock",
    "Session",
    "describe_now",
    "describe_scene",
    "drive",
    "open_session",
    "start_meshcat",
]
