"""Frames between processes of one machine through shared memory. Alone imports iceoryx2.

**How one frame travels.** The camera's ``FrameWriter`` loans memory from iceoryx2, and the pixels
are copied into it, or decoded from a JPEG; the header's bytes follow them. It sends the sample and
rings a ``Doorbell``, a number that all receivers wait for, as iceoryx2's own waiting would stop
every thread of a Python process. The ``FrameReader`` of each consumer, a thread, passes the sample
to an intake like any other: the same checks of identity, order, size and age, the same counters.

**Who owns which memory when.** The camera until it has sent, then nobody writes to it any more. A
receiver's sample is a read-only view; what refers to it, such as ``Frame.pixels``, keeps it, and
the memory is given back when nothing does. So a frame stays as it is for as long as someone has
it, although it was not copied. A consumer may hold ``VIEWS`` of them; one that keeps more gets
copies instead. There is room for this for each consumer, so nobody holds the camera up. One
sample waits for each consumer, and a newer one replaces it.

**Who takes which way.** A camera whose process can use shared memory declares the liveliness token
``@{namespace}/shm/{camera}/{machine}/{offer}``. ``{machine}`` is made from the boot, the mounted
/dev/shm and the user, so a consumer knows without trying whether it shares that memory;
``{offer}`` is new at each start. Doorbell and service of iceoryx2 are named after the whole key;
anyone can declare tokens, and those without a doorbell, which lies in a folder that only this user
can write to, are none. A consumer that takes frames this way subscribes to the same key,
on which nothing is published: the camera writes to shared memory only while someone does, and no
JPEG while nobody subscribes to those. Both statements end with their process, however it ends.

**At the switch.** Whoever takes frames as JPEG goes on until the first one came through shared
memory, then ends that subscription. When the token goes away, or nothing comes through shared
memory for 3 s, it subscribes to JPEG again. Frames of both ways are one stream with one
``EpochGate``; a frame that came both ways is dropped as ``duplicate``.

**When memory runs out.** A write to a page that /dev/shm has no room for would end the process, so
each piece of memory is reserved before it is first used. If there is none, the camera withdraws its
offer, reports it, and offers again later: consumers go on with JPEG. What killed processes left is
removed when the next one opens or offers: locks that the kernel releases tell who is dead.

Linux only, since the doorbell is a futex; wheels of iceoryx2 need glibc 2.34.
"""
