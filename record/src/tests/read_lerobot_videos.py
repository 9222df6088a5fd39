"""Videos of a LeRobot dataset, read by PyAV."""

from fractions import Fraction

import av
import numpy as np


def planes(frame):
    """Luma and both chroma planes, as hexadecimal numbers."""
    sizes = [(frame.width, frame.height)] + 2 * [(frame.width // 2, frame.height // 2)]
    cut = []
    for plane, (width, height) in zip(frame.planes, sizes):
        rows, step = bytes(plane), plane.line_size
        cut.append(b"".join(rows[k * step : k * step + width] for k in range(height)).hex())
    return dict(zip("yuv", cut))


def rgb(frame):
    """Pixels as PyAV 15 converts them, which LeRobot requires: by its default matrix, whatever the file says."""
    by_file = frame.to_ndarray(format="rgb24")
    frame.colorspace = 2
    pixels = frame.to_ndarray(format="rgb24")
    np.testing.assert_array_equal(by_file, pixels, err_msg="the matrix of the file is another one")
    return pixels


def info(path):
    """Description of a stream, as `get_video_info` of LeRobot reads it."""
    with av.open(path) as container:
        (stream,) = container.streams
        return {
            "video.height": stream.height,
            "video.width": stream.width,
            "video.codec": stream.codec.canonical_name,
            "video.pix_fmt": stream.pix_fmt,
            "video.fps": int(stream.base_rate),
            "video.channels": 3,
            "has_audio": bool(container.streams.audio),
            "is_depth_map": False,
        }


def frames(path, fps):
    """All frames of a file."""
    found = []
    with av.open(path) as container:
        (stream,) = container.streams
        assert stream.average_rate == fps, stream.average_rate
        for frame in container.decode(stream):
            assert frame.pts * stream.time_base == Fraction(len(found), fps), "frames have their exact times"
            about = stream.codec_context
            color = [int(about.color_primaries), int(about.color_trc), int(about.colorspace), {1: "tv", 2: "pc"}[int(about.color_range)]]
            found.append({"color": color, "size": [frame.width, frame.height], "is_key": bool(frame.key_frame), **planes(frame), "rgb": rgb(frame)})
        assert stream.duration * stream.time_base == Fraction(len(found), fps)
    return found


def frame_at(path, time):
    """The frame at a time [s], read as LeRobot does: from the key frame before it. Also the number of decoded frames."""
    with av.open(path) as container:
        (stream,) = container.streams
        container.seek(round(time / stream.time_base) - 1, backward=True, any_frame=False, stream=stream)
        for number, frame in enumerate(container.decode(stream), 1):
            found = float(frame.pts * stream.time_base)
            if found >= np.float32(time) - 1e-4:
                assert abs(found - time) <= 1e-4, (found, time)
                return rgb(frame), number
    raise AssertionError(f"no frame at {time}")


def read(root, description, episodes):
    """Frames of each video feature, in the order of the dataset."""
    features = description["features"]
    names = [name for name, feature in features.items() if feature["dtype"] == "video"]
    if not names:
        assert description["video_path"] is None and not (root / "videos").exists()
        return {}
    output, files = {}, set()
    for name in names:
        place = lambda episode: tuple(episode[f"videos/{name}/{what}_index"] for what in ("chunk", "file"))
        path_of = lambda chunk, file: root / description["video_path"].format(video_key=name, chunk_index=chunk, file_index=file)
        videos = {place(episode): frames(path_of(*place(episode)), description["fps"]) for episode in episodes}
        files |= {path_of(*of) for of in videos}
        expected = {"video.g": 2, **info(path_of(0, 0))}
        assert features[name]["info"] == expected, (features[name], expected)
        used, output[name] = dict.fromkeys(videos, 0), []
        for episode in episodes:
            video, first = videos[place(episode)], used[place(episode)]
            used[place(episode)] = end = first + episode["length"]
            times = [episode[f"videos/{name}/{what}_timestamp"] for what in ("from", "to")]
            assert times == [first / description["fps"], end / description["fps"]], (times, first, end)
            # Each episode begins with a key frame, and no frame is far from one.
            assert [frame["is_key"] for frame in video[first:end]] == [k % 2 == 0 for k in range(end - first)]
            for k in {0, episode["length"] // 2, episode["length"] - 1}:
                pixels, decoded = frame_at(path_of(*place(episode)), times[0] + float(np.float32(k / description["fps"])))
                np.testing.assert_array_equal(pixels, video[first + k]["rgb"])
                assert decoded <= 4, decoded
            output[name] += video[first:end]
        assert used == {of: len(video) for of, video in videos.items()}, "each frame belongs to an episode"
        assert sorted(videos) == [(0, k) for k in range(len(videos))], "files are numbered without gaps"
    assert set((root / "videos").rglob("*.mp4")) == files, "no other file"
    return output
