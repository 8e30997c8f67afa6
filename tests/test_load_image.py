"""Pictures to weighted points: where pixels stand, what they weigh, and what is refused."""

import io
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from symrefine.errors import InputError
from symrefine.load import IMAGES, load
from symrefine.load.image import LARGEST, otsu, pixel_weights
from symrefine.shape import Shape

# An L, dark on light, 4 rows of 5 pixels: (column, row) of the dark ones.
DARK = [(1, 0), (1, 1), (1, 2), (2, 2)]
EXPECTED = sorted((c + 0.5, 4 - r - 0.5) for c, r in DARK)


def letter(object_grey: int = 0, background: int = 255, dtype: Any = np.uint8) -> np.ndarray:
    pixels = np.full((4, 5), background, dtype=dtype)
    for c, r in DARK:
        pixels[r, c] = object_grey
    return pixels


def encoded(image: Image.Image, kind: str = "PNG", **options: Any) -> bytes:
    data = io.BytesIO()
    image.save(data, format=kind, **options)
    return data.getvalue()


def loaded(folder: Path, image: Image.Image | np.ndarray | bytes, name: str = "a.png", **options: Any) -> Shape:
    if isinstance(image, np.ndarray):
        image = Image.fromarray(image)
    path = folder / name
    kinds = {".png": "PNG", ".bmp": "BMP", ".jpg": "JPEG", ".jpeg": "JPEG"}
    path.write_bytes(image if isinstance(image, bytes) else encoded(image, kinds[path.suffix.lower()]))
    return load(path, **options)


def refusal(folder: Path, image: Image.Image | np.ndarray | bytes, name: str = "a.png", **options: Any) -> str:
    with pytest.raises(InputError) as caught:
        loaded(folder, image, name, **options)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(str(folder / name)) or "threshold" in message
    return message


def points_of(shape: Shape) -> list[tuple[float, float]]:
    return sorted(map(tuple, shape.points.tolist()))


# --- geometry and polarity --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["a.png", "a.bmp", "A.PNG"])
def test_pixels_stand_at_their_centres_with_y_up(tmp_path: Path, name: str) -> None:
    shape = loaded(tmp_path, letter(), name)
    assert points_of(shape) == EXPECTED
    assert shape.weights is not None
    assert set(shape.weights) == {1.0}
    assert shape.source == str(tmp_path / name)


@pytest.mark.parametrize(("dark", "light"), [(0, 255), (255, 0), (90, 91), (200, 10)])
def test_what_most_of_the_border_shows_is_background(tmp_path: Path, dark: int, light: int) -> None:
    assert points_of(loaded(tmp_path, letter(dark, light))) == EXPECTED


def test_an_object_that_fills_the_picture_is_told_by_the_border_alone() -> None:
    grey = np.ones((9, 9))
    grey[1:-1, 1:-1] = 0.0
    assert pixel_weights(grey).sum() == 49
    tie = np.array([[0.0, 0.0, 1.0, 1.0]] * 2)
    assert pixel_weights(tie)[0].tolist() == [1.0, 1.0, 0.0, 0.0], "of equals, light is background"


def test_invert_exchanges_object_and_background(tmp_path: Path) -> None:
    shape = loaded(tmp_path, letter(), invert=True)
    assert len(shape.points) == 16
    assert not set(points_of(shape)) & set(EXPECTED)
    grey = np.array([[0.2, 0.2, 0.2], [0.2, 0.9, 0.2], [0.2, 0.5, 0.2]])
    np.testing.assert_allclose(pixel_weights(grey, invert=True) + pixel_weights(grey), 0.7)


# --- grey and colour --------------------------------------------------------------------------------------------------


def test_grey_pixels_weigh_their_distance_from_the_background(tmp_path: Path) -> None:
    pixels = np.full((6, 6), 200, np.uint8)
    pixels[2, 2:4] = (100, 250)
    shape = loaded(tmp_path, pixels)
    assert points_of(shape) == [(2.5, 3.5), (3.5, 3.5)]
    assert shape.weights is not None
    np.testing.assert_allclose(shape.weights * 255, [100, 50])


def test_the_scatter_of_the_border_weighs_nothing() -> None:
    rng = np.random.default_rng(0)
    grey = 0.8 + 0.01 * rng.standard_normal((40, 40))
    grey[10:20, 10:30] = 0.2
    weights = pixel_weights(grey)
    assert (weights[10:20, 10:30] > 0.5).all()
    assert np.count_nonzero(weights) < 205


def test_colour_becomes_grey_by_itu_r_601(tmp_path: Path) -> None:
    pixels = np.zeros((5, 5, 3), np.uint8)
    pixels[1, 1], pixels[2, 2], pixels[3, 3] = (255, 0, 0), (0, 255, 0), (0, 0, 255)
    shape = loaded(tmp_path, pixels)
    assert shape.weights is not None
    np.testing.assert_allclose(shape.weights, [0.299, 0.587, 0.114], atol=1e-12)
    neutral = loaded(tmp_path, np.repeat(letter(77, 201)[:, :, None], 3, axis=2))
    assert points_of(neutral) == EXPECTED, "two greys in colour are two levels"


def test_thresholds(tmp_path: Path) -> None:
    pixels = np.full((6, 6), 250, np.uint8)
    pixels[2, 1:5] = (20, 120, 200, 30)
    assert len(loaded(tmp_path, pixels).points) == 4
    assert len(loaded(tmp_path, pixels, threshold=0.6).points) == 3
    assert len(loaded(tmp_path, pixels, threshold=0.2).points) == 2
    assert len(loaded(tmp_path, pixels, threshold="otsu").points) == 3
    shape = loaded(tmp_path, pixels, threshold=0.6, invert=True)
    assert len(shape.points) == 33
    assert otsu(np.repeat([0.1, 0.9], [30, 500])) == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("mode", ["1", "L", "P", "RGB", "RGBA", "LA", "CMYK", "I;16"])
def test_every_kind_of_pixel(tmp_path: Path, mode: str) -> None:
    if mode == "I;16":
        shape = loaded(tmp_path, letter(3, 60000, np.uint16))
    else:
        image = Image.fromarray(letter()).convert(mode)
        shape = loaded(tmp_path, image) if mode != "CMYK" else loaded(tmp_path, image, "a.jpg", threshold=0.5)
    assert points_of(shape) == EXPECTED


@pytest.mark.parametrize("ink", [0, 255, 40])
def test_what_is_transparent_is_background_whatever_its_colour(tmp_path: Path, ink: int) -> None:
    rng = np.random.default_rng(1)
    pixels = rng.integers(256, size=(4, 5, 4), dtype=np.uint8)
    pixels[:, :, 3] = 0
    for c, r in DARK:
        pixels[r, c] = (ink, ink, ink, 255)
    assert points_of(loaded(tmp_path, pixels)) == EXPECTED


def test_half_transparent_pixels_weigh_half(tmp_path: Path) -> None:
    pixels = np.zeros((5, 5, 4), np.uint8)
    pixels[2, 1:3, 3] = (255, 102)
    weights = loaded(tmp_path, pixels).weights
    assert weights is not None
    np.testing.assert_allclose(weights, [1.0, 0.4], atol=1e-9)


def test_pictures_stand_as_viewers_show_them(tmp_path: Path) -> None:
    image = Image.fromarray(letter())
    exif = Image.Exif()
    exif[0x0112] = 6  # turn clockwise to view
    shape = loaded(tmp_path, encoded(image, exif=exif))
    # Clockwise: column c, row r goes to column 3 - r, row c of a picture 5 rows high.
    assert points_of(shape) == sorted((3 - r + 0.5, 5 - c - 0.5) for c, r in DARK)


def test_jpeg(tmp_path: Path) -> None:
    pixels = np.full((64, 48), 255, np.uint8)
    pixels[16:48, 8:24] = 0
    for name in ("a.jpg", "a.jpeg"):
        shape = loaded(tmp_path, pixels, name, threshold="otsu")
        assert len(shape.points) == 32 * 16
        np.testing.assert_allclose(shape.points.mean(axis=0), [16, 32])


# --- what is refused --------------------------------------------------------------------------------------------------


def test_pictures_without_an_object(tmp_path: Path) -> None:
    assert "all 5 x 4 pixels have the same grey value 1" in refusal(tmp_path, letter(255, 255))
    assert "the same grey value" in refusal(tmp_path, np.zeros((4, 5, 4), np.uint8))
    message = refusal(tmp_path, letter(100, 120), threshold=0.9)
    assert "grey values run from 0.392 to 0.471; choose a threshold between them, not 0.9" in message
    grain = np.random.default_rng(0).integers(100, 140, (60, 60)).astype(np.uint8)
    assert "nothing stands out: grey values run from 0.392 to 0.545; try threshold 'otsu'" in refusal(tmp_path, grain)
    one = np.full((5, 5), 255, np.uint8)
    one[2, 2] = 0
    assert "only one point, [2.5, 2.5]" in refusal(tmp_path, one)


@pytest.mark.parametrize("name", ["a.png", "a.bmp", "a.jpg"])
def test_truncated_pictures_wherever_they_are_cut(tmp_path: Path, name: str) -> None:
    pixels = np.random.default_rng(0).integers(256, size=(9, 7), dtype=np.uint8)
    kind = {"png": "PNG", "bmp": "BMP", "jpg": "JPEG"}[name[-3:]]
    data = encoded(Image.fromarray(pixels), kind)
    # A PNG is complete without the checksum of its empty last chunk.
    for size in range(1, len(data) - (4 if kind == "PNG" else 0), 1 if kind == "PNG" else 5):
        assert f"{kind} image" in refusal(tmp_path, data[:size], name)


def test_damage_never_shows_as_a_foreign_error(tmp_path: Path) -> None:
    data = bytearray(encoded(Image.fromarray(np.random.default_rng(0).integers(256, size=(9, 7), dtype=np.uint8))))
    rng = np.random.default_rng(2)
    for _ in range(150):
        broken = bytearray(data)
        broken[rng.integers(len(data))] = rng.integers(256)
        with suppress(InputError):
            loaded(tmp_path, bytes(broken))


@pytest.mark.parametrize("suffix", sorted(IMAGES))
def test_empty_and_meaningless_files(tmp_path: Path, suffix: str) -> None:
    assert "is empty (0 bytes)" in refusal(tmp_path, b"", f"a{suffix}")
    assert "image: begins with 'solid'" in refusal(tmp_path, b"solid", f"a{suffix}")


def test_a_picture_of_another_format_than_its_name(tmp_path: Path) -> None:
    assert "not a BMP image" in refusal(tmp_path, encoded(Image.fromarray(letter())), "a.bmp")


def test_animations(tmp_path: Path) -> None:
    frames = [Image.fromarray(letter(k)) for k in (0, 50, 100)]
    data = encoded(frames[0], save_all=True, append_images=frames[1:])
    assert "holds 3 pictures, an animation or a series; save one of them by itself" in refusal(tmp_path, data)


def test_pictures_that_are_too_large(tmp_path: Path) -> None:
    side = int(LARGEST**0.5) + 1
    assert "scale it down" in refusal(tmp_path, encoded(Image.new("1", (side, side))))
    bomb = encoded(Image.new("1", (20000, 20000)))
    assert "scale it down" in refusal(tmp_path, bomb)


@pytest.mark.parametrize("threshold", [0.0, 1.0, -3.0, 128.0, float("nan"), "auto"])
def test_thresholds_that_are_none(tmp_path: Path, threshold: Any) -> None:
    assert "expected a grey value between 0 (black) and 1 (white)" in refusal(tmp_path, letter(), threshold=threshold)


def test_options_go_with_their_kind_of_file(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("0,0\n1,1\n")
    for options in ({"threshold": 0.5}, {"invert": True}):
        with pytest.raises(InputError, match=r"a\.csv: threshold and invert apply to pictures and volumes only: \.bmp"):
            load(tmp_path / "a.csv", **options)
    assert "measure 'solid' does not apply" in refusal(tmp_path, letter(), measure="solid")
    (tmp_path / "b.png").mkdir()
    with pytest.raises(InputError, match="is a directory"):
        load(tmp_path / "b.png")
    (tmp_path / "a.gif").touch()
    with pytest.raises(InputError, match=r"and images \.bmp \.jpeg \.jpg \.png, and \.gz of each$"):
        load(tmp_path / "a.gif")
