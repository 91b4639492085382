"""The recipe of the target completion."""

import learning
import pytest
import torch

from interpose import parts
from interpose.errors import InputError
from interpose.train.common import checkpoint
from interpose.train.target import recipe


def test_a_training_resumes_and_says_what_it_is(database, tmp_path):
    out = tmp_path / "run"
    assert recipe.train([database.path], out, "tiny") == "finished"
    saved = checkpoint.load(out)
    assert (saved["step"], saved["config"]["completes"]) == (4, "target")
    assert saved["config"]["styles"] == list(learning.STYLES)
    model = recipe.model_of(saved)
    assert model.size.styles == 2
    assert float(model.std.min()) >= 0.0099
    assert recipe.train([database.path], out, "tiny") == "finished"
    with pytest.raises(InputError, match="no preset 'huge'"):
        recipe.train([database.path], out, "huge")


def test_masks_are_the_groups_that_users_name():
    joints, ground = recipe.masks(4000, torch.Generator().manual_seed(0), torch.device("cpu"))
    drawn = torch.cat([joints, ground], dim=-1)
    assert (drawn.sum(dim=-1) > 0).all()
    for name in [*parts.GROUPS, "ground"]:
        given = parts.parse(name)
        want = torch.tensor([*given.known, given.ground]).float()
        assert (drawn == want).all(dim=-1).float().mean() > 0.03, name


def test_pairs_are_of_one_clip_and_in_order(frames):
    config = recipe.TargetConfig(size=recipe.TargetSize(styles=2), strayed=0.0)
    known, _ = recipe.draw(frames, config, 500, torch.Generator().manual_seed(1))
    start = (frames.hips[:, None] == known.start_hips).all(dim=-1).float().argmax(dim=0)
    target = (frames.hips[:, None] == known.target_hips).all(dim=-1).float().argmax(dim=0)
    assert (frames.first[start] == frames.first[target]).all()
    torch.testing.assert_close((target - start).float()[:, None], known.frames)
    moving = known.velocity_known[:, 0] > 0
    assert 0.3 < moving.float().mean() < 0.6
    moved = (frames.positions[start] - frames.positions[start - 1])[moving] * 30.0
    torch.testing.assert_close(known.start_velocities[moving], moved)
    assert (known.start_velocities[~moving] == 0).all()


def test_learning_lowers_the_error(frames):
    config = recipe.TargetConfig(size=recipe.TargetSize(2, 32, 1, styles=2), half=False)
    generator = torch.Generator().manual_seed(0)
    torch.manual_seed(0)
    model = recipe.TargetPose(config.size)
    recipe.set_statistics(model, frames, config, generator)
    before = recipe.ratios(model, frames, config, 64)
    assert before["free/hips"] == pytest.approx(1.0, abs=0.1)
    model.train()
    optimizer = torch.optim.AdamW(model.parameters(), lr=3e-3)
    for _ in range(25):
        known, true = recipe.draw(frames, config, 64, generator)
        total, _ = recipe.losses(model, known, true, config, generator)
        optimizer.zero_grad()
        total.backward()
        optimizer.step()
    after = recipe.ratios(model, frames, config, 64)
    assert after["free/head"] < 0.9 * before["free/head"]
