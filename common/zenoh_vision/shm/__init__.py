"""Frames between processes of one machine through shared memory. Only this package uses iceoryx2.

**How one frame travels.** The camera's ``FrameWriter`` loans memory from iceoryx2. A video's planes
or a webcam's YUYV are converted into it, and pixels are copied; a JPEG or PNG stays as it is, since
a receiver may need only its grey values or a part of its pixels. The header's bytes follow. It
sends the sample and rings a ``Doorbell``, a number that all receivers wait for, as iceoryx2's own
waiting would stop every thread of a Python process. The ``FrameReader`` of each consumer passes the
sample to an intake like any other: the same checks of identity, order, size and age, the same
counters.

**Ownership of memory.** The camera owns the memory until it has sent it; after that, nobody writes
to it. A receiver's sample is a read-only view. Everything that refers to it, such as
``Frame.pixels``, keeps it alive; without references, the memory is given back. So a frame does not
change while someone has it, although it was not copied. A consumer may hold ``VIEWS`` samples; one
that keeps more gets copies instead. Memory is reserved for this for each consumer, so no consumer
blocks the camera. One sample waits for each consumer, and a newer one replaces it.

**Discovery.** A camera whose process can use shared memory declares the liveliness token
``@{namespace}/shm/{camera}/{machine}/{offer}``. ``{machine}`` is made from the boot, the mounted
/dev/shm and the user, so a consumer knows without trying whether it shares that memory; ``{offer}``
is new at each start. Doorbell and service of iceoryx2 are named after the whole key; anyone can
declare tokens, so a token counts only if its doorbell exists, in a folder to which only this user
can write. A consumer of these frames subscribes to the same key, on which nothing is published: the
camera writes to shared memory only while someone subscribes to it, and encodes JPEGs only while
someone subscribes to those. Token and subscription end with their process, however it ends.

**Switching.** A consumer of JPEGs keeps its subscription until the first frame came through shared
memory. When the token disappears, or nothing comes through shared memory for 3 s, it subscribes to
JPEG again. Frames of both routes are one stream with one ``EpochGate``; a frame that arrives twice
is dropped as ``duplicate``.

**When memory runs out.** A write to a page that /dev/shm has no room for would end the process, so
each piece of memory is reserved before it is first used. If there is none, the camera withdraws its
offer, reports it, and offers again later: consumers go on with JPEG. Files of killed processes are
removed when the next one opens or offers: their locks, which the kernel released, show that they
are dead.

Linux only, since the doorbell is a futex; wheels of iceoryx2 need glibc 2.34.
"""
