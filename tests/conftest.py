from __future__ import annotations

import matplotlib
import pytest
from title_and_axes import TITLE_AND_AXES

# Set here, not in the environment, which the kernels of the notebooks inherit: they draw inline.
matplotlib.use("Agg")

# Failed assertions of the helpers beside this file tell what came, as those of the tests do.
pytest.register_assert_rewrite("exact_terms", "faults", "steps")


@pytest.fixture
def ax(request):
    """An empty panel of a figure, whose title and axes get the names written out in `title_and_axes`."""
    import matplotlib.pyplot as plt

    from gpbnb.report.display import style

    figure, axes = style.figure()
    yield axes[0]
    drawn = request.path.stem.endswith("_drawn")
    if drawn and (expected := TITLE_AND_AXES.get(f"{request.path.parent.name} {request.node.name}")):
        (panel,) = figure.axes
        found = panel.get_title(loc="left") or panel.get_title(), panel.get_xlabel(), panel.get_ylabel()
        assert found == expected
    figure.canvas.draw()  # a figure that cannot be drawn, or warns, is of no use
    panel = figure.axes[0]
    if panel.axison and panel.xaxis.label.get_fontsize() == style.TEXT:  # not after `clear`, which loses the style
        assert style.defects(figure, placed=False) == []
    plt.close("all")
