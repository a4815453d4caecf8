"""Reports in a browser: what is written on a picture does not overlap."""

import numpy as np
import pytest
from browser import BROWSER, Tab, browse

from lhpost6_pin.show.report.page import Page, Section, save_page
from lhpost6_pin.show.report.plots import Row, palette_traces, time_figure
from lhpost6_pin.show.report.scales import SCALES

pytestmark = [pytest.mark.long, pytest.mark.skipif(BROWSER is None, reason="no Chromium on this computer")]

OVERLAPS = """(async () => {
  const plot = document.querySelector('.plot'), names = '.legendtext, .legend2text';
  const boxes = (what) => [...plot.querySelectorAll(what)].map((one) => one.getBoundingClientRect());
  while (boxes(names).length < COUNT) await new Promise((later) => setTimeout(later, 50));
  const meet = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
  const titles = boxes('.annotation-text');
  return [titles.length, titles.filter((a) => boxes(names).some((b) => meet(a, b))).length];
})()"""


@pytest.mark.parametrize("count", [2, 9])
def test_the_title_of_a_row_is_clear_of_its_legend(tmp_path, count):
    names = [f"a longer name, no. {k}" for k in range(count)]
    rows = [
        Row("Actuators, struts, weight, inertia", palette_traces(names, np.ones((50, count))), SCALES["force"]),
        Row("Power", palette_traces(names[:1], np.ones((50, 1))), SCALES["force"]),
    ]
    figure = time_figure("one", "One", "Some words.", rows, start=0.0, step=0.1)
    path = tmp_path / "page.html"
    save_page(Page("Report", "t", "p", "v", "good", [], [Section("s", "S", [figure])]), path)

    async def look(tab: Tab):
        return await tab.evaluate(OVERLAPS.replace("COUNT", str(1 + count)))

    assert browse(tmp_path, path.as_uri(), look) == [2, 0]
