"""Rows made up, for tests of the report."""

import msgspec
from meshreel_bench.rows import Decoding, Encoding, Group, Point, Row, Stream


def row(sequence, codec, mbps, db, **changed):
    """Return a measured point of ten frames whose other qualities follow from its dB."""
    metrics = {
        "d2_psnr_paper": db,
        "d2_psnr_paper_worst": db - 1,
        "symmetric_psnr": db - 2,
        "normal_error_deg": (90 - db) / 5,
        "ssim": 0.9 + db / 1000,
        "ssim_masked": db / 100,
    }
    made = Row(
        point=Point(sequence, codec, {"quality": mbps}),
        name=codec,
        options={"quality": mbps},
        frames=10,
        measured_frames=list(range(10)),
        stream=Stream(round(mbps * 1e6 / 8 / 3), 10, 0, [Group(0, 10, "layers", 100, 5)]),
        encoding=Encoding(7.0, {"code": 7.0}, 100.0),
        decoding=Decoding(5.0, mbps + 1, 100.0, 90.0),
        metrics=metrics,
        per_frame={"d2_psnr_paper": [db] * 10, "ssim_masked": [db / 100] * 10},
    )
    return msgspec.structs.replace(made, **changed)


def floor(sequence, **metrics):
    """Return the row of the truth itself."""
    return Row(point=Point(sequence, "captured"), name="the truth itself", frames=10, metrics=metrics)


def failed(sequence, codec, reason):
    """Return a point of which nothing was measured."""
    return Row(point=Point(sequence, codec, {"qp": 9}), name=codec, options={"qp": 9}, failed=reason)
