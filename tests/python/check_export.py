"""Opens what the ignored test `pictures_to_look_at` wrote with NumPy and Pillow.

From the project's root:
    cargo test --release -p sinew-tests --test pictures -- --ignored
    python3 tests/python/check_export.py
"""

from pathlib import Path

import numpy as np
from PIL import Image

FOLDER = Path("out/pictures")

walk = np.load(FOLDER / "walk.npy")
assert walk.dtype == np.dtype("<f4") and walk.shape[0] == 90 and walk.shape[2] == 3
assert walk.flags.c_contiguous and np.isfinite(walk).all()
assert 1.5 < walk[0, :, 1].max() < 2.0, "a standing body, in metres"

gif = Image.open(FOLDER / "walk.gif")
durations = []
for frame in range(gif.n_frames):
    gif.seek(frame)
    durations.append(gif.info["duration"])
assert gif.info["loop"] == 0, "forever"
assert sum(durations) == 3000, "90 frames at 30 a second"
assert (FOLDER / "walk.gif").stat().st_size < 2_500_000

# Equal neighbours are one frame that shows longer: find the one on show after 45 of them.
gif.seek(int(np.searchsorted(np.cumsum(durations), 1500, side="right")))
shown = np.asarray(gif.convert("RGB")).astype(float)
drawn = np.asarray(Image.open(FOLDER / "walk_45.png")).astype(float)
error = np.abs(shown - drawn)
assert error.mean() < 2.0, f"mean error {error.mean():.2f} of 255"

for name in ["body.png", "sheet.png", "chart.png"]:
    picture = Image.open(FOLDER / name)
    picture.load()
    assert picture.mode == "RGB"
print(f"OK: GIF differs from the picture by {error.mean():.2f} of 255 on average")
