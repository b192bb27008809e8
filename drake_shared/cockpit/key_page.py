"""The page that a browser without the key receives."""

from __future__ import annotations

import html

from aiohttp import web

_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>drake_shared: key needed</title>
<style>
:root {{ color-scheme: light dark; }}
body {{ font: 16px/1.5 system-ui, sans-serif; margin: 0; min-height: 100vh;
       display: grid; place-items: center;
       background: light-dark(#e9edf1, #161e27); color: light-dark(#18222c, #eef3f7); }}
main {{ max-width: 30em; padding: 24px 32px; margin: 16px; border-radius: 12px;
       background: light-dark(#ffffff, #1f2a35); }}
h1 {{ font-size: 20px; margin: 0 0 8px; }}
p {{ margin: 0; }}
</style>
</head>
<body><main><h1>This page needs its key</h1><p>{text}</p></main></body>
</html>
"""


def key_page(text: str) -> web.HTTPForbidden:
    """Returns the response 403 that says in ``text`` what to do, as a page."""
    policy = "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'"
    return web.HTTPForbidden(
        text=_PAGE.format(text=html.escape(text)),
        content_type="text/html",
        headers={"Content-Security-Policy": policy},
    )
