"""narpa for Python: CAN messages from the DBC file, camera frames, LiDAR packets, rotations.

    narpa.can       open a bus, send and receive pose commands and all other messages by their names in narpa.dbc
    narpa.dbc       DBC files: messages, signals, encoding
    narpa.y4m       video streams, as `narpa run --video CAMERA=FILE.y4m` writes them
    narpa.vlp16     VLP-16 data packets, as `narpa run --lidar LIDAR=udp:HOST:PORT` sends them
    narpa.points    packets of LiDARs that are described by a file
    narpa.pcap      UDP datagrams of a capture
    narpa.ouster    lidar packets of Ouster sensors, decoded with the sensor's metadata
    narpa.rotation  quaternions (w, x, y, z)
    narpa.plots     the plots of narpa's commands (needs matplotlib)

python/README.md shows how to use them; examples/ has whole programs.
"""
