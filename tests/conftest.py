"""Fixtures that all tests share."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# The same examples in each run: what is green here is green elsewhere. New ones: HYPOTHESIS_PROFILE=search make test.
settings.register_profile("repeatable", derandomize=True)
settings.register_profile("search", derandomize=False, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the real recordings beside the checkout; a checkout alone does not have it."""
    if not SHARED_DATA.is_dir():
        pytest.skip(
            f"the real recordings are not beside this checkout ({SHARED_DATA.name} folder absent): nothing to read"
        )
    return SHARED_DATA
