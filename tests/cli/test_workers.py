"""Worker processes of commands tell how far they are."""

from meshreel.cli.workers import workers
from meshreel.encoder.run.worker import tell


def test_what_workers_tell_arrives_once():
    with workers(2) as executor:
        for future in [executor.submit(tell, call, "track", done) for call in (3, 4) for done in (1, 2)]:
            future.result()
        assert sorted(executor.told()) == [(3, "track", 1), (3, "track", 2), (4, "track", 1), (4, "track", 2)]
        assert list(executor.told()) == []
