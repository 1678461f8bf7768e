"""ROS 1: publish VIDEO QUALITY|raw, subscribe N QUALITY|raw; ROS_MASTER_URI names the master."""

import sys

import cv2
import numpy as np
import rospy
from cv_bridge import CvBridge
from measuring import Ages, jpeg_of, paced_frames
from sensor_msgs.msg import CompressedImage, Image

RAW_BYTES = 16 << 20  # as ROS's wiki advises for large messages


def stamp_of(stamp_ns):
    """Return nanoseconds as a time of ROS."""
    return rospy.Time(stamp_ns // 10**9, stamp_ns % 10**9)


def publish(path, form):
    """Publish images until terminated."""
    rospy.init_node("peer_camera", disable_signals=True)
    kind = Image if form == "raw" else CompressedImage
    publisher = rospy.Publisher("image", kind, queue_size=1)
    bridge = CvBridge()
    for frame, stamp_ns in paced_frames(path):
        if form == "raw":
            message = bridge.cv2_to_imgmsg(frame, "bgr8")
        else:
            message = CompressedImage(format="jpeg", data=jpeg_of(frame, int(form)).tobytes())
        message.header.stamp = stamp_of(stamp_ns)
        publisher.publish(message)


def subscribe(wanted, form):
    """Make each message an array in the callback, as the tutorials of cv_bridge do."""
    rospy.init_node("peer_consumer", disable_signals=True)
    ages = Ages(int(wanted))
    bridge = CvBridge()

    def on_image(message):
        if form == "raw":
            bridge.imgmsg_to_cv2(message, "bgr8")
        else:
            cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_COLOR)
        ages.note(message.header.stamp.to_nsec())

    kind = Image if form == "raw" else CompressedImage
    rospy.Subscriber("image", kind, on_image, queue_size=1, buff_size=RAW_BYTES, tcp_nodelay=True)
    rospy.spin()


if __name__ == "__main__":
    {"publish": publish, "subscribe": subscribe}[sys.argv[1]](*sys.argv[2:])
