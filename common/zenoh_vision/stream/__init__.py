"""Receives samples: checks identity, order and age, and buffers them. Does not import Zenoh.

An ``Intake`` turns samples into frames, messages or counted drops. A transport calls its
``receive``, the consumer its ``take``. Which frames a consumer sees:

- **Identity.** The header must be valid, name the camera of the key, carry times that are neither
  negative nor over 24 h ahead, and agree with the size in the picture's own header. For a bare
  picture a header is created on arrival and marked ``assumed``.
- **Order.** Within an epoch only a higher ``seq``, by no more than a camera can have counted since
  the last one: 1000 plus 1000 for each second. A frame is checked on arrival and again when it is
  handed out.
- **A new epoch must be verified.** Anyone can send a header with a high epoch and a broken
  picture. If such a frame took over on arrival, the true camera's frames would be of an older
  epoch and be refused. So a new epoch is unverified until the first of its frames was decoded, and
  its frames wait in a separate queue, so that they replace no frame of the current epoch.
- **Silence.** After 1.5 s without an accepted frame an older epoch may follow: a camera that was
  started again after its clock was set back. Frames of the same epoch that were refused for their
  ``seq`` may follow too, if they have arrived for 1.5 s in order and equally late: otherwise one
  picture with a high ``seq`` would end a stream.
- **Several keys.** An input with wildcards has a state for each key, from its first frame with a
  good header until it was silent for a minute. Of more than 1000 keys, a new one replaces the one
  that has been silent longest; if all sent frames within 1.5 s, it is refused.
- **Age.** ``now - stamp`` contains the difference of two clocks, so its excess over its own
  minimum of the last minute counts. Over ``max_age`` the frame is ``stale``. This detects frames
  that waited in buffers outside of this process, after a process was stopped or a link was cut.
  Only accepted frames set the minimum. A stamp earlier than the one before it in the same epoch, or
  a new epoch that stays equally late for 1.5 s, indicates another clock, and the minimum is reset.

``FrameCounters`` counts arrivals, processed and dropped items; the totals always balance.
"""
