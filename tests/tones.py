"""Audio files of a tone, made here, for tests of what is heard."""

import io

import numpy as np

RATE = 48_000  # Hz
CODECS = {"ogg": "libopus", "webm": "libopus", "mp4": "aac", "adts": "aac", "mp3": "libmp3lame", "wav": "pcm_s16le"}


def tone(seconds: float, container: str = "ogg") -> bytes:
    """The bytes of an audio file. Needs PyAV."""
    import av

    file = io.BytesIO()
    with av.open(file, "w", format=container, options={"fflags": "+bitexact"}) as out:
        stream = out.add_stream(CODECS[container], rate=RATE)
        stream.layout, stream.bit_rate = "mono", 32_000
        time = np.arange(int(seconds * RATE)) / RATE
        samples = (0.3 * np.sin(2 * np.pi * 440 * time)).astype(np.float32)
        for at in range(0, len(samples), 960):
            frame = av.AudioFrame.from_ndarray(samples[None, at : at + 960], format="fltp", layout="mono")
            frame.sample_rate, frame.pts = RATE, at
            for packet in stream.encode(frame):
                out.mux(packet)
        for packet in stream.encode(None):
            out.mux(packet)
    return file.getvalue()
