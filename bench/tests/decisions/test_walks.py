"""The walk of decision 45: a path in a hand before the room, and rows of what the table shows."""

import numpy as np
import pytest
from meshreel_bench.decisions.tables import COLUMNS, table
from meshreel_bench.decisions.walks import rows, walking

from meshreel.capture.simulated.stage import BOX


def test_the_camera_stays_before_the_open_side_and_moves_as_a_hand_does():
    path = walking(40).path
    eyes = np.array([path[k].to_world[:3, 3] for k in range(40)])
    steps = np.linalg.norm(np.diff(eyes, axis=0), axis=1)
    assert (eyes[:, 2] > BOX[1, 2]).all() and (np.abs(eyes[:, 0]) < BOX[1, 0]).all()
    assert steps.min() > 0 and steps.max() < 0.3 and steps.sum() > 2  # m


@pytest.mark.slow
def test_rows_have_what_the_table_shows(tmp_path):
    pytest.importorskip("av")
    still, walk = rows(tmp_path, count=6, width=96)
    assert walk["case"] == "simulated: a walk of 6 frames" and "before_mm" not in still
    assert 0 < walk["people_covered"] <= 1 and walk["all_covered"] > 0.8 and walk["all_invented"] < 0.1
    assert len(table("walks", [{"decision": "walks"} | still, {"decision": "walks"} | walk]).splitlines()) == 4
    assert "walks" in COLUMNS
