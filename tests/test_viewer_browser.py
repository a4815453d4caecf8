"""Pages of the viewer in a browser: no errors, the platen where the record has it, keys and boxes that work."""

import asyncio
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from browser import BROWSER, Tab, browse
from tornado.websocket import websocket_connect

from lhpost6_pin.core.names import AXES
from lhpost6_pin.data.records import load_record
from lhpost6_pin.mechanics.equilibrium import find_equilibrium
from lhpost6_pin.show.bodies import body_name, body_poses, joint_positions
from lhpost6_pin.show.viewer import LiveView, Look, live_animation, record_frames, show_record, view_apart
from lhpost6_pin.show.viewer.window import LoopbackWindow
from lhpost6_pin.simulation.running import RunningPlant
from lhpost6_pin.simulation.snapshot import EVERY

pytestmark = [pytest.mark.long, pytest.mark.skipif(BROWSER is None, reason="no Chromium on this computer")]

RECORD = Path(__file__).parent / "data" / "records" / "practice_a_EQ_ridgecrest2019_ccc.nc"

AT = "(name) => viewer.scene_tree.find(['meshcat', 'table', ...name.split('/')]).object"
DRAWN = "new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn)))"


@pytest.fixture(scope="module")
def record():
    return load_record(RECORD).isel(time=slice(0, 512 * 12))


@pytest.fixture(scope="module")
def page(machine, record, tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("page") / "out.html"
    other = record.assign(platen_displacement=0.9 * record["platen_displacement"])
    show_record(machine, record, [other], Look(amplify=3.0)).save(path)
    return path.as_uri()


def share(pixels: np.ndarray, colour: tuple[int, int, int], within: int = 40) -> float:
    """Share of a picture that is nearly of a colour."""
    return float(np.mean(np.abs(pixels - colour).max(axis=-1) < within))


def test_the_page_has_no_errors_and_the_platen_is_where_the_record_has_it(machine, bodies, record, page, tmp_path):
    times = [0.0, 8.0, 10.0]

    async def look(tab: Tab):
        await tab.evaluate("viewer.animator.pause()")
        poses, pictures = [], []
        for k, time in enumerate(times):
            await tab.evaluate(f"seek({time}), {DRAWN}")
            read = "[...at(n).position.toArray(), ...at(n).quaternion.toArray()]"
            names = ["platen", "H2_rod", "first_other"]
            poses.append(await tab.evaluate(f"{{ const at = {AT}; {names}.map((n) => {read}) }}"))
            pictures.append(await tab.picture(tmp_path / f"{k}.png"))
        return tab.faults, np.array(poses), pictures

    faults, poses, pictures = browse(tmp_path, page, look)
    assert faults == []
    frames = record_frames(machine, record, look=Look(amplify=3.0))
    model = bodies.model
    moments = frames.displacement[[round(30 * t) for t in times]]
    wanted = body_poses(model, joint_positions(machine, model, moments))
    names = [body_name(model, joint) for joint in range(model.njoints)]
    # the page's numbers are in single precision, 1e-7 of 10 m
    np.testing.assert_allclose(poses[:, 0], wanted[:, names.index("platen")], atol=2e-6)
    np.testing.assert_allclose(poses[:, 1, :3], wanted[:, names.index("H2_rod"), :3], atol=2e-6)
    assert np.ptp(poses[:, 0, :3], axis=0).max() > 0.02
    assert np.abs(poses[1:, 2, 0] - 0.9 * moments[1:, 0]).max() < 0.05  # the box's middle is half a metre below C
    for picture in pictures:
        assert share(picture, (0, 100, 165)) > 0.05  # the platen covers a sixth of the page
    for last, now in pairwise(pictures):
        assert np.sum(np.abs(now - last).max(axis=-1) > 8) > 1000


def test_keys_and_boxes_play_step_and_hide(page, tmp_path):
    async def look(tab: Tab):
        seen = {}
        await tab.key(" ")
        seen["paused"] = not await tab.evaluate("viewer.animator.playing")
        await tab.evaluate("seek(5)")
        await tab.key("ArrowRight")
        seen["time"] = await tab.evaluate("viewer.animator.time")
        await tab.evaluate(f"seek(1e9), {DRAWN}")
        seen["end"] = await tab.evaluate("[viewer.animator.time, document.getElementById('clock').textContent]")
        await tab.evaluate(f"seek(0), {DRAWN}")
        with_arrows = await tab.picture(tmp_path / "with.png")
        boxes = "[...document.querySelectorAll('#layers label')]"
        seen["layers"] = await tab.evaluate(f"{boxes}.map((l) => l.textContent.trim())")
        await tab.evaluate(f"{boxes}.find((l) => l.textContent.includes('forces')).click(), {DRAWN}")
        without = await tab.picture(tmp_path / "without.png")
        seen["violet"] = share(with_arrows, (94, 60, 153)), share(without, (94, 60, 153))
        await tab.evaluate("document.activeElement.blur()")  # on a box, space is the box's
        await tab.key(" ")
        seen["playing"] = await tab.evaluate("viewer.animator.playing")
        return tab.faults, seen

    faults, seen = browse(tmp_path, page, look)
    assert faults == []
    assert seen["paused"] and seen["playing"], seen
    assert abs(seen["time"] - (5 + 1 / 30)) < 1e-6  # one frame
    end, clock = seen["end"]
    assert abs(end - 11.967) < 1e-3 and clock == "11.97 / 11.97 s"  # 12 s less a sample and less what is no frame
    assert seen["layers"][:2] == ["names", "path of C"] and seen["layers"][-1] == "forces" and len(seen["layers"]) == 5
    before, after = seen["violet"]  # the struts' pull; shades of the struts themselves come near
    assert before > 1e-3 and after < 0.1 * before


def test_a_computer_too_slow_for_every_pixel_draws_fewer_while_the_table_moves(page, tmp_path):
    """Frames are said to have come every so many milliseconds; none is drawn in between."""
    ask = "(frame, count) => { frames = 0; for (let k = 0; k < count; k++) keep_pace(frame * k); return drawn; }"

    async def look(tab: Tab):
        seen = {}
        for name, frame, count in (("slow", 60, 20), ("slower", 500, 200), ("fast", 16, 200), ("steady", 30, 200)):
            await tab.evaluate("animator.play()")
            seen[name] = await tab.evaluate(f"({ask})({frame}, {count})")
        await tab.evaluate(f"({ask})(500, 200), animator.pause(), {DRAWN}")
        seen["paused"] = await tab.evaluate("drawn")
        return seen

    seen = browse(tmp_path, page, look)
    assert seen["slower"] == 0.4 < seen["slow"] < 0.8  # the least; half the pixels
    assert seen["fast"] == seen["steady"] == seen["paused"] == 1


def test_long_labels_of_the_legend_stay_within_its_box(machine, record, tmp_path):
    other = record.assign_attrs(title="a long name of a motion at scale 0.8 on LHPOST6, simulated once more")
    path = tmp_path / "long.html"
    show_record(machine, record, [other]).save(path)
    rights = "(...of) => Math.max(...of.map((e) => e.getBoundingClientRect().right))"

    async def look(tab: Tab):
        await tab.evaluate(DRAWN)
        box = await tab.evaluate(f"({rights})(document.querySelector('#caption'))")
        return box, await tab.evaluate(f"({rights})(...document.querySelectorAll('#caption .kind'))")

    box, labels = browse(tmp_path, path.as_uri(), look)
    assert 0.5 * box < labels < box


def test_a_narrow_window_sees_the_whole_table(page, tmp_path):
    async def look(tab: Tab):
        await tab.evaluate(f"viewer.animator.pause(), seek(0), {DRAWN}")
        return await tab.picture(tmp_path / "narrow.png")

    picture = browse(tmp_path, page, look, size=(420, 900))
    columns = np.flatnonzero((np.abs(picture - (0, 100, 165)).max(axis=-1) < 40).any(axis=0))
    assert columns.size and columns.min() > 5 and columns.max() < picture.shape[1] - 6  # the platen ends inside


def test_the_page_of_this_computer_shows_the_table(machine, record, tmp_path):
    async def look(tab: Tab):
        while not await tab.evaluate("viewer.animator.duration > 0"):
            await asyncio.sleep(0.05)
        await tab.evaluate(DRAWN)
        return tab.faults, await tab.picture(tmp_path / "live.png")

    with live_animation(machine, record.isel(time=slice(0, 2048))) as window:
        faults, picture = browse(tmp_path, window.url, look)
    assert faults == []
    assert share(picture, (0, 100, 165)) > 0.05 and share(picture, (230, 159, 0)) > 0.005  # platen, horizontals


def moved(plant, show) -> None:
    """Half a second of a plant whose first actuator is driven hard, shown as it moves."""
    rest = find_equilibrium(plant)
    table, spool = RunningPlant(plant, rest), rest.spool.copy()
    spool[0] += 0.2
    for sample in range(1024):
        if sample % EVERY == 0:
            show(table.snapshot())
        table.advance(spool)


@pytest.mark.parametrize(
    "apart",
    [
        pytest.param(False, id="in one process"),
        # loads the package once more; test_running watches a run of the command line, whose view is such a process
        pytest.param(True, id="in a process of its own", marks=pytest.mark.slow),
    ],
)
def test_a_live_view_follows_the_plant(plant, machine, tmp_path, apart):
    def view():
        return view_apart(machine, "live") if apart else LiveView(machine, "live", real_time=False)

    with view() as found:
        url, show = found if apart else (found.url, found.show)

        async def look(tab: Tab):
            where = f"({AT})('platen').position.toArray()"
            while not await tab.evaluate("document.getElementById('meshcat-pane').childElementCount > 0"):
                await asyncio.sleep(0.05)
            await asyncio.to_thread(moved, plant, show)
            for _ in range(200):
                status = await tab.evaluate("document.getElementById('status').textContent")
                if status.startswith("0.5 s" if not apart else "0."):
                    break
                await asyncio.sleep(0.05)
            meters = "[...document.querySelectorAll('#meters span')].map((m) => m.textContent)"
            return tab.faults, status, await tab.evaluate(where), await tab.evaluate(meters)

        faults, status, platen, meters = browse(tmp_path, url, look)
    assert faults == [] and "largest force" in status
    assert [words.split()[0] for words in meters] == [*AXES, *machine.actuator_names]
    centre = np.array(machine.platen.centre_of_gravity)
    assert np.linalg.norm(platen - centre) > 1e-3  # it has left its place


def test_a_live_view_waits_while_it_is_paused(plant, machine, tmp_path):
    rest = RunningPlant(plant, find_equilibrium(plant)).snapshot()
    with LiveView(machine, "live") as view:
        press = "document.getElementById('pause').click()"

        async def look(tab: Tab):
            while await tab.evaluate("document.getElementById('live').hidden"):
                await asyncio.to_thread(view.show, rest)
            await tab.evaluate(press)
            waiting = asyncio.create_task(asyncio.to_thread(_until_paused, view, rest))
            await asyncio.sleep(1.0)
            paused = not waiting.done()
            await tab.evaluate(press)
            await asyncio.wait_for(waiting, 60)
            return tab.faults, paused

        faults, paused = browse(tmp_path, view.url, look)
    assert faults == [] and paused


def _until_paused(view: LiveView, snapshot) -> None:
    """Show a snapshot again and again until a pause has come, and one after it has ended."""
    while not view._window.paused.is_set():
        view.show(snapshot)
    view.show(snapshot)


def test_a_pause_ends_with_the_run_and_with_the_last_viewer(plant, machine):
    rest = RunningPlant(plant, find_equilibrium(plant)).snapshot()
    with LiveView(machine, "live", ended=lambda: True) as view:
        view._window.paused.set()
        view.show(rest)  # returns

    async def pause_and_leave(window: LoopbackWindow) -> bool:
        browser = await websocket_connect(window.url.replace("http", "ws") + "commands")
        await browser.write_message("pause")
        while not window.paused.is_set():
            await asyncio.sleep(0.01)
        browser.close()
        while window.paused.is_set():
            await asyncio.sleep(0.01)
        return True

    with LoopbackWindow("") as window:
        assert asyncio.run(asyncio.wait_for(pause_and_leave(window), 60))


def test_a_browser_without_webgl_says_so_in_place_of_the_table(page, tmp_path):
    """As with Chromium's --disable-3d-apis: the page was blank but for its legend."""
    without = "<body><script>HTMLCanvasElement.prototype.getContext = () => null</script>"
    (tmp_path / "without.html").write_text(Path(page.removeprefix("file://")).read_text().replace("<body>", without, 1))

    async def look(tab: Tab):
        return await tab.evaluate("[part('undrawn').checkVisibility(), part('undrawn').textContent]")

    seen, words = browse(tmp_path, (tmp_path / "without.html").as_uri(), look)
    assert seen and "WebGL, which this browser does not provide" in words
    assert not browse(tmp_path, page, look)[0]


def test_histories_move_with_the_animation_and_show_the_force_of_the_leg_pressed(page, tmp_path):
    press = "(x, y) => { for (const type of ['pointerdown', 'pointerup']) document.elementFromPoint(x, y)"
    press += ".dispatchEvent(new PointerEvent(type, { clientX: x, clientY: y, bubbles: true, pointerId: 1 })) }"
    place = f"(name) => {{ const p = ({AT})(name).getWorldPosition(new MeshCat.THREE.Vector3()); "
    place += "p.project(viewer.camera); return [(p.x + 1) / 2 * innerWidth, (1 - p.y) / 2 * innerHeight] }"

    async def look(tab: Tab):
        await tab.evaluate(f"animator.pause(), seek(3), {DRAWN}")
        seen = {"line": await tab.evaluate("plots.map(({ line }) => parseFloat(line.style.left))")}
        seen["inked"] = await tab.evaluate(
            "plots.map(({ canvas: c }) => c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some((v) => v))"
        )
        await tab.evaluate(
            "(() => { HTMLElement.prototype.setPointerCapture = () => {}; const box = plots[0].field"
            ".getBoundingClientRect(); plots[0].field.dispatchEvent(new PointerEvent('pointerdown', "
            "{ clientX: box.left + box.width / 4, clientY: box.top + 5, pointerId: 1 })) })()"
        )
        seen["time"] = await tab.evaluate("[animator.time, known]")
        seen["first"] = await tab.evaluate("forces.chosen")
        await tab.evaluate(f"(([x, y]) => ({press})(x, y))(({place})('H4_barrel'))")
        seen["pressed"] = await tab.evaluate("[forces.chosen, forces.choice.value]")
        return tab.faults, seen

    faults, seen = browse(tmp_path, page, look, (1280, 900))
    assert faults == []
    time, known = seen["time"]
    assert time == pytest.approx(known / 4, abs=known / 200)  # a pixel of the plot
    assert seen["line"] == pytest.approx([100.0 * 3.0 / known] * 3, abs=0.01) and all(seen["inked"])
    assert seen["first"] == "H1" and seen["pressed"] == ["H4", "H4"]
