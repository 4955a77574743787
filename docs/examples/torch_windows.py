"""Windows of a body's frames for torch: `python torch_windows.py scan.reel` prints their shapes.

The float64 positions of decoded groups are rounded straight into the memory of a float32 tensor, without other copies.
"""

import sys

import torch
from torch.utils.data import DataLoader, Dataset

import meshreel


class Windows(Dataset):
    """Windows of `length` frames in which a body keeps its vertices and faces."""

    def __init__(self, path: str, length: int = 4, track: int = 0) -> None:
        self.video, self.length, self.track = meshreel.open(path), length, track
        self.windows = []
        for run in self.video.tracks[track].topology:  # decodes the file once
            faces = torch.from_numpy(run.faces)
            count = sum(rows.stop for rows in run.parts.values())
            firsts = range(run.first, run.last - length + 1, length) if count else ()  # none without the body
            self.windows += [(first, count, faces) for first in firsts]

    def __len__(self) -> int:
        return len(self.windows)

    def __getitem__(self, index: int) -> tuple[torch.Tensor, torch.Tensor]:
        """Return positions (length x V x 3, m, float32) and faces (F x 3, int32)."""
        first, count, faces = self.windows[index]
        positions = torch.empty(self.length, count, 3)
        self.video.tracks[self.track].vertices(first, first + self.length, positions.numpy())
        return positions, faces


if __name__ == "__main__":
    # Without batches: windows of different runs have different numbers of vertices.
    for positions, faces in DataLoader(Windows(sys.argv[1]), batch_size=None, num_workers=1):
        print(tuple(positions.shape), tuple(faces.shape))
