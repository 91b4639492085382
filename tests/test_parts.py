"""Target joints by name."""

import numpy as np
import pytest

from interpose import parts
from interpose.errors import InputError
from interpose.skeleton import HUMANOID


def names(text):
    return [HUMANOID.names[joint] for joint in parts.parse(text).joints]


def test_groups_and_joints_are_read_together():
    assert names("hips, LEFT-HAND,neck") == ["Hips", "Neck", "LeftHand"]
    assert names("right-foot") == ["RightFoot", "RightToe"]
    assert parts.parse("ground") == parts.Parts((), True)
    assert parts.parse("head,Ground") == parts.Parts((HUMANOID.index("Head"),), True)
    np.testing.assert_array_equal(np.flatnonzero(parts.parse("hands").known), [17, 21])


def test_upper_and_lower_are_the_whole():
    assert not set(names("upper")) & set(names("lower"))
    assert parts.parse("upper,lower").whole
    assert not parts.parse("upper,ground").whole


def test_parts_are_written_as_they_are_read():
    for text in ("Hips,LeftHand,ground", "ground", "Head"):
        assert str(parts.parse(text)) == text


@pytest.mark.parametrize("text", ["", "hips,", "tail", "hips;head"])
def test_what_is_no_joint_is_refused(text):
    with pytest.raises(InputError, match=r"there is no target joint '.*'; give hips, hands"):
        parts.parse(text)
