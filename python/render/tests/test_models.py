"""Images of models of other projects, three views each, against those of MuJoCo's own renderer."""

import dataclasses
import os
import statistics

import comparison
import models
import page
import pytest
from conftest import version

SIZE = (96, 128)
# Models that every tested version reads, and those of KINETOSCOPE_ROBOTS.
LEAST_MODELS = 60


@pytest.fixture(name="rows", scope="module")
def rows_fixture():
    """Rows by model and view. CI sets the folder of models."""
    if not os.environ.get(models.FOLDER):
        pytest.skip(f"{models.FOLDER} is not set")
    rows = {}
    for name, path in models.paths().items():
        assert path.exists(), path
        model = models.load(path)
        if model is not None:
            rows[name] = {
                view: dataclasses.asdict(row) for view, row in comparison.compare_model(model, SIZE).items()
            }
    return rows


def column(rows, key):
    return [row[key] for views in rows.values() for row in views.values()]


def test_number_of_models(rows):
    assert len(rows) >= LEAST_MODELS, sorted(rows)
    assert all(len(views) == 3 for views in rows.values())


def test_depth(rows):
    """The median view. Before 3.0, depth of MuJoCo itself differs from closed forms by up to a percent."""
    assert statistics.median(column(rows, "depth")) < (1e-6 if version() >= (3, 0) else 1e-2)


def test_segmentation(rows):
    equal = column(rows, "segmentation")
    assert statistics.median(equal) >= 0.999
    assert sum(x >= 0.999 for x in equal) >= 0.9 * len(equal)


def test_color(rows):
    """The bar is that of the page, whose images have the same size."""
    colors = column(rows, "psnr")
    print(f"median {statistics.median(colors):.1f} dB")
    assert statistics.median(colors) >= 40


def test_low_views(rows):
    """Each view that is much worse than the others has a cause on the page."""
    unknown = {key: value for key, value in page.low_views({"models": rows}).items() if key not in page.CAUSES}
    assert not unknown, unknown


def test_page():
    """The page has the tables of `benchmarks/agreement.json`, and a cause of each low view."""
    assert page.is_current(), "run: python python/render/benchmarks/agreement.py --page"
    assert "unknown" not in page.tables()
