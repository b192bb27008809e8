"""A page on which logs and demonstrations are looked at, filtered, and laid over each other.

- `catalogue`: which trials and demonstrations a folder holds, from the metadata of its files alone
- `details`: what the page shows of one of them
- `page`: the page, stand-alone or served
"""

from drake_shared.analysis.viewer.catalogue import Catalogue
from drake_shared.analysis.viewer.page import Viewer, write_page

__all__ = ["Catalogue", "Viewer", "write_page"]
