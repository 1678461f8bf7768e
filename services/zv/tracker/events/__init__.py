"""Events from tracks: pure arithmetic on tracks, stamps and shapes, without network or clock.

`TrackEvents` takes the tracks of each processed frame and returns what happened: a track started,
was confirmed, lost, ended; entered or left a zone or stayed in it; crossed a line. What counts as
each, and its stamp, is in docs/events.md.
"""
