"""The URLs of ROS's web_video_server: /stream, /snapshot and /stream_viewer."""
