"""What is held out of a database."""

import learning

from interpose.data.split import training_ranges


def test_the_end_of_long_clips_is_held_out(tmp_path):
    data = learning.write_database(tmp_path / "db", lengths=(1040, 1039, 1, 4000))
    training, held_out = training_ranges(data)
    assert held_out == [(910, 1040), (5840, 6080)]
    assert training == [(0, 910), (1040, 2079), (2080, 5840)]
    short = learning.write_database(tmp_path / "short", lengths=(150, 90))
    assert training_ranges(short) == ([(0, 150), (150, 240)], [(0, 150)])
