"""The site that ships, as a layout."""

from __future__ import annotations

import functools

from lhdmap.haulage.layout import Layout
from lhdmap.haulage.site import find_site, load_site
from lhdmap.haulage.site_layout import layout_of_site


@functools.cache
def hejase() -> Layout:
    return layout_of_site(load_site(find_site("hejase")))
