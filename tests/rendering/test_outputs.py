import errno
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gasp_core.errors import GaspError, RenderingError
from gasp_core.rendering.contact_sheet import Sheet, contact_sheet, key_frames
from gasp_core.rendering.outputs import open_output
from gasp_core.rendering.pictures import PictureFile, PictureFolder, write_png
from gasp_core.rendering.video import FilmFile


def picture(index, width=96, height=64, channels=3):
    """Smooth, moving, and of every colour."""
    y, x = np.mgrid[:height, :width]
    waves = [np.sin(x / 9 + index / 3), np.sin(y / 7 - index / 4), np.cos((x + y) / 11), np.ones_like(x)]
    return ((np.stack(waves[:channels], axis=2) * 0.5 + 0.5) * 255).astype(np.uint8)


def decoded(path):
    import av

    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        frames = [
            frame.reformat(format="rgb24", src_colorspace="ITU709").to_ndarray() for frame in container.decode(stream)
        ]
        return frames, stream.average_rate, stream.codec_context


def psnr(a, b):
    return -10 * np.log10(np.mean((a / 255.0 - b / 255.0) ** 2))


def written(output, pictures):
    with output:
        for index, frame in enumerate(pictures):
            if output.wants(index):
                output.take(frame, index / 25)


def muted(index):
    """Detail in brightness, colours that change slowly, as things are: video stores a quarter of all colours."""
    grey = picture(index)[:, :, 2:]
    return (0.6 * grey + 0.4 * picture(0).mean(axis=(0, 1)) * [1.1, 1.0, 0.7]).clip(0, 255).astype(np.uint8)


def test_a_film_shows_what_it_was_given(tmp_path):
    pictures = [muted(k) for k in range(12)]
    written(FilmFile(tmp_path / "film.mp4", 25), pictures)
    frames, rate, _ = decoded(tmp_path / "film.mp4")
    assert len(frames) == 12 and rate == 25
    assert min(psnr(a, b) for a, b in zip(frames, pictures)) >= 35


@pytest.mark.parametrize("name", ["film.webm", "film.gif"])
def test_films_for_pages(tmp_path, name):
    pictures = [muted(k) for k in range(12)]
    written(open_output(tmp_path / name, count=12, frame_rate=25, title="t"), pictures)
    frames, rate, _ = decoded(tmp_path / name)
    assert len(frames) == 12 and float(rate) == pytest.approx(25)
    # The .gif has all of their few colours.
    with np.errstate(divide="ignore"):
        assert min(psnr(a, b) for a, b in zip(frames, pictures)) >= 35


def test_a_gif_goes_on_and_is_no_faster_than_browsers_show_it(tmp_path):
    written(FilmFile(tmp_path / "film.gif", 200), [picture(k) for k in range(12)])
    with Image.open(tmp_path / "film.gif") as film:
        assert film.n_frames == 3 and film.info["loop"] == 0 and film.info["duration"] == 20
        first = np.asarray(film.convert("RGB"))
        film.seek(1)
        second = np.asarray(film.convert("RGB"))
    # Of thousands of colours, 256 and a pattern of them.
    assert psnr(first, picture(0)) > 20 and psnr(second, picture(4)) > 20 and psnr(first, second) < 15


@pytest.mark.parametrize("rate", [50, 51, 60, 74, 124])
def test_no_gif_is_faster_than_browsers_show_it(tmp_path, rate):
    written(FilmFile(tmp_path / "film.gif", rate), [picture(k) for k in range(6)])
    with Image.open(tmp_path / "film.gif") as film:
        assert film.n_frames == (6 if rate == 50 else 2 if rate == 124 else 3)
        # In hundredths of a second, the third frame's rounded down or up.
        assert film.info["duration"] >= 20


def test_films_that_can_be_transparent_are(tmp_path):
    import av

    clear = np.dstack([muted(0), np.full((64, 96), 255, np.uint8)])
    clear[:, :48, 3] = 0
    for name in ("film.webm", "film.gif"):
        written(FilmFile(tmp_path / name, 25), [clear] * 3)
    with Image.open(tmp_path / "film.gif") as film:
        alpha = np.asarray(film.convert("RGBA"))[:, :, 3]
        assert (alpha[:, :48] == 0).all() and (alpha[:, 48:] == 255).all()
    # FFmpeg's own decoder of VP9 passes transparency over; browsers and libvpx read it.
    decoder = av.codec.CodecContext.create("libvpx-vp9", "r")
    with av.open(str(tmp_path / "film.webm")) as container:
        frames = [frame for packet in container.demux(video=0) if packet.size for frame in decoder.decode(packet)]
    alpha = frames[0].reformat(format="rgba").to_ndarray()[:, :, 3]
    assert (alpha[:, :40] < 20).all() and (alpha[:, 56:] > 235).all()


def test_a_film_says_how_its_colours_are_stored(tmp_path):
    """Players take an untagged film for BT.601 or BT.709 as they like: greens and reds would shift."""
    written(FilmFile(tmp_path / "film.mp4", 25), [picture(0)])
    _, _, context = decoded(tmp_path / "film.mp4")
    assert (context.colorspace, context.color_primaries, context.color_trc, context.color_range) == (1, 1, 1, 1)


@pytest.mark.parametrize("colour", [(255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255), (0, 0, 0), (128, 64, 32)])
def test_flat_colours_come_back(tmp_path, colour):
    flat = np.full((32, 32, 3), colour, np.uint8)
    written(FilmFile(tmp_path / "film.mp4", 25), [flat] * 2)
    frames, _, _ = decoded(tmp_path / "film.mp4")
    # 8 bits of Y, Cb, Cr over 219 and 224 steps: rounding each by half moves R, G, B by up to
    # 255 (0.5 / 219 + 1.86 * 0.5 / 224) = 1.6, and the codec by about a step more.
    assert np.abs(frames[0].astype(int) - colour).max() <= 4


@pytest.mark.parametrize("size", [(1, 1), (3, 5), (2, 1), (17, 16), (95, 63)])
def test_sizes_that_video_does_not_know(tmp_path, size):
    frame = picture(0, *size)
    written(FilmFile(tmp_path / "film.mp4", 25), [frame] * 3)
    frames, _, _ = decoded(tmp_path / "film.mp4")
    assert len(frames) == 3
    assert frames[0].shape == (size[1] + size[1] % 2, size[0] + size[0] % 2, 3)


def test_slow_and_odd_frame_rates(tmp_path):
    for rate in (25 / 4, 29.97, 0.5, 240, 0.4 / 1000, 0.37 / 1000):
        written(FilmFile(tmp_path / "film.mp4", rate), [picture(k) for k in range(3)])
        frames, found, _ = decoded(tmp_path / "film.mp4")
        assert len(frames) == 3 and float(found) == pytest.approx(rate, rel=1e-3)


@pytest.mark.parametrize("name", ["film.mp4", "film.webm", "film.gif", "frames", "sheet.png", "one.png"])
def test_nothing_is_left_of_what_failed_and_what_was_there_stays(tmp_path, name):
    def output():
        return open_output(tmp_path / name, count=1 if name == "one.png" else 3, frame_rate=25, title="t")

    def failing():
        with output() as opened:
            opened.take(picture(0), 0.0)
            raise GaspError("the disk is full")

    with pytest.raises(GaspError, match="disk is full"):
        failing()
    assert list(tmp_path.iterdir()) == []
    written(output(), [picture(k) for k in range(3)])
    before = everything(tmp_path)
    with pytest.raises(GaspError, match="disk is full"):
        failing()
    assert everything(tmp_path) == before


def everything(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_folder_of_pictures_replaces_an_older_film_and_nothing_else(tmp_path):
    folder = tmp_path / "frames"
    written(PictureFolder(folder), [picture(k) for k in range(5)])
    written(PictureFolder(folder), [picture(k + 1) for k in range(2)])
    assert sorted(path.name for path in folder.iterdir()) == ["frame_0000.png", "frame_0001.png"]
    assert np.array_equal(np.asarray(Image.open(folder / "frame_0001.png")), picture(2))
    (folder / "notes.txt").write_text("mine")
    with pytest.raises(RenderingError, match="holds other things than pictures"):
        written(PictureFolder(folder), [picture(0)])
    assert (folder / "notes.txt").exists() and len(list(tmp_path.iterdir())) == 1


def test_a_link_to_a_folder_of_pictures_stays_one(tmp_path):
    folder, link = tmp_path / "frames", tmp_path / "link"
    link.symlink_to(folder)
    for count in (5, 2):
        written(PictureFolder(link), [picture(k) for k in range(count)])
        assert link.is_symlink() and len(list(folder.iterdir())) == count
    assert sorted(tmp_path.iterdir()) == [folder, link]


def test_pictures_in_the_current_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for count in (3, 2):
        written(open_output(Path(), count=count, frame_rate=25, title="t"), [picture(k) for k in range(count)])
        assert sorted(path.name for path in Path().iterdir()) == [f"frame_{k:04d}.png" for k in range(count)]


def test_where_new_pictures_cannot_come_to_their_place_the_older_ones_stay(tmp_path, monkeypatch):
    folder = tmp_path / "frames"
    written(PictureFolder(folder), [picture(k) for k in range(3)])
    before = everything(tmp_path)
    replace = Path.replace

    def refusing(path, target):
        if path.name == "frame_0001.png" and path.parent.name == "made":
            raise OSError(errno.EIO, "Input/output error")
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", refusing)
    with pytest.raises(RenderingError, match="no files can be made there"):
        written(PictureFolder(folder), [picture(k + 5) for k in range(2)])
    assert everything(tmp_path) == before


def test_transparency_is_kept_in_pictures_and_refused_in_films(tmp_path):
    clear = picture(0, channels=4)
    clear[:, :48, 3] = 0
    written(PictureFile(tmp_path / "one.png"), [clear])
    assert np.array_equal(np.asarray(Image.open(tmp_path / "one.png")), clear)
    with pytest.raises(RenderingError, match="cannot be transparent"):
        written(FilmFile(tmp_path / "film.mp4", 25), [clear])
    assert [path.name for path in tmp_path.iterdir()] == ["one.png"]


def test_a_sheet_has_the_key_frames_and_no_others(tmp_path):
    written(Sheet(tmp_path / "sheet.png", "a fall", key_frames(31)), [picture(k) for k in range(31)])
    sheet = np.asarray(Image.open(tmp_path / "sheet.png"))
    for index in range(31):
        there = found(sheet, picture(index))
        assert there == (index in key_frames(31)), index


def found(sheet, part):
    """Whether a picture stands somewhere in a sheet."""
    height, width = part.shape[:2]
    rows, columns = np.nonzero((sheet[: -height + 1, : -width + 1] == part[0, 0]).all(axis=2))
    return any(np.array_equal(sheet[y : y + height, x : x + width], part) for y, x in zip(rows, columns))


def test_a_wide_frame_is_made_small(tmp_path):
    sheet = Sheet(tmp_path / "sheet.png", "", [0], cell=48)
    written(sheet, [picture(0)])
    assert np.asarray(Image.open(tmp_path / "sheet.png")).shape[1] < 96


@pytest.mark.parametrize("count", [1, 2, 7, 12, 13])
@pytest.mark.parametrize("size", [(16, 9), (1, 1), (9, 16), (480, 270)])
def test_sheets_of_any_number_and_shape(count, size):
    cells = [(picture(k, *size), float(k)) for k in range(count)]
    sheet = contact_sheet(cells, "title")
    assert sheet.shape[2] == 3
    assert sheet.shape[0] * sheet.shape[1] >= count * size[0] * size[1]


def test_key_frames_are_even_and_have_both_ends():
    assert key_frames(51) == [0, 5, 9, 14, 18, 23, 27, 32, 36, 41, 45, 50]
    assert key_frames(3) == [0, 1, 2]
    assert key_frames(1) == [0]


@pytest.mark.parametrize(
    ("name", "count", "kind"),
    [
        ("a.mp4", 3, FilmFile),
        ("a.MP4", 1, FilmFile),
        ("a.png", 3, Sheet),
        ("a.png", 1, PictureFile),
        ("a", 3, PictureFolder),
    ],
)
def test_the_name_says_what_is_made(tmp_path, name, count, kind):
    assert type(open_output(tmp_path / name, count=count, frame_rate=25, title="")) is kind


@pytest.mark.parametrize("name", ["a.avi", "a.jpg", "a.gasp"])
def test_other_endings_are_refused(tmp_path, name):
    with pytest.raises(RenderingError, match=r"can be a film \(.mp4, .webm, .gif\)"):
        open_output(tmp_path / name, count=3, frame_rate=25, title="")


def test_places_that_are_none(tmp_path):
    with pytest.raises(RenderingError, match="there is no folder"):
        open_output(tmp_path / "none" / "a.mp4", count=3, frame_rate=25, title="")
    (tmp_path / "b.mp4").mkdir()
    with pytest.raises(RenderingError, match="is a folder"):
        open_output(tmp_path / "b.mp4", count=3, frame_rate=25, title="")


def test_without_pyav_films_are_refused_before_anything_is_painted(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(RenderingError, match=r"films need PyAV.*pip install av, or write pictures"):
        written(FilmFile(tmp_path / "film.mp4", 25), [picture(0)])
    assert list(tmp_path.iterdir()) == []


def test_without_the_codec_films_are_refused(tmp_path, monkeypatch):
    import av

    real = av.open

    class WithoutCodec:
        def __init__(self, container):
            self._container = container

        def add_stream(self, name, **options):
            raise av.codec.codec.UnknownCodecError(name)

        def close(self):
            self._container.close()

    monkeypatch.setattr(av, "open", lambda *args, **options: WithoutCodec(real(*args, **options)))
    with pytest.raises(RenderingError, match=r"no H\.264 encoder"):
        written(FilmFile(tmp_path / "film.mp4", 25), [picture(0)])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_a_full_disk(tmp_path, monkeypatch):
    target = FilmFile(tmp_path / "film.mp4", 25)
    monkeypatch.setattr(target, "_beside", type(target.path)("/dev/full"))
    monkeypatch.setattr(type(target.path), "unlink", lambda self, missing_ok=False: None)
    with pytest.raises(RenderingError, match="cannot be written"):
        written(target, [picture(k) for k in range(300)])
    assert not target.path.exists()


def test_no_picture_no_film(tmp_path):
    for output in (
        FilmFile(tmp_path / "a.mp4", 25),
        Sheet(tmp_path / "a.png", "", [0]),
        PictureFile(tmp_path / "b.png"),
    ):
        with pytest.raises(RenderingError, match="there is no picture"):
            written(output, [])
    assert list(tmp_path.iterdir()) == []


def test_a_png_is_lossless(tmp_path):
    write_png(tmp_path / "a.png", picture(3))
    assert np.array_equal(np.asarray(Image.open(tmp_path / "a.png")), picture(3))
