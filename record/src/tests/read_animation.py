"""Prints the frames of an animation as JSON: times in milliseconds, and pixels. Read by Pillow or PyAV."""

import sys

import av
from PIL import Image, ImageSequence
from reader_output import print_json


def pillow(path):
    at, frames = 0, []
    with Image.open(path) as animation:
        assert animation.is_animated and animation.info["loop"] == 0, "played for ever"
        for frame in ImageSequence.Iterator(animation):
            frame.load()
            until = at + round(frame.info["duration"])
            frames.append({"from": at, "until": until, "size": list(frame.size), "rgb": frame.convert("RGB").tobytes().hex()})
            at = until
    return frames


def ffmpeg(path):
    def milliseconds(units, base):
        exact = units * base * 1000
        assert exact == round(exact), exact
        return round(exact)

    frames = []
    with av.open(path) as container:
        (stream,) = container.streams
        assert stream.codec_context.name == "h264" and stream.codec_context.pix_fmt == "yuv420p", stream
        for frame in container.decode(stream):
            planes = []
            for plane, (width, height) in zip(frame.planes, [(frame.width, frame.height)] + 2 * [(frame.width // 2, frame.height // 2)]):
                rows, step = bytes(plane), plane.line_size
                planes.append(b"".join(rows[k * step : k * step + width] for k in range(height)).hex())
            about = stream.codec_context
            color = [int(about.color_primaries), int(about.color_trc), int(about.colorspace), {1: "tv", 2: "pc"}[int(about.color_range)]]
            frames.append({
                "from": milliseconds(frame.pts, stream.time_base),
                "until": milliseconds(frame.pts + frame.duration, stream.time_base),
                "size": [frame.width, frame.height],
                "y": planes[0],
                "u": planes[1],
                "v": planes[2],
                "color": color,
            })
        assert milliseconds(stream.duration, stream.time_base) == frames[-1]["until"], stream.duration
        # As FFmpeg finds it in the stream, and as the file says it. 20 images of 32 x 24 pixels per second fit into the lowest levels.
        about = stream.codec_context
        assert (frames[0]["size"], about.level) == ([32, 24], about.extradata[3]) and 10 <= about.level <= 12, about.level
    # A player that jumps to the end finds the last frame.
    with av.open(path) as container:
        (stream,) = container.streams
        container.seek(stream.duration - 1, stream=stream)
        last = [frame for frame in container.decode(stream)][-1]
        assert milliseconds(last.pts, stream.time_base) == frames[-1]["from"]
    return frames


path = sys.argv[1]
print_json({"frames": ffmpeg(path) if path.endswith(".mp4") else pillow(path)})
