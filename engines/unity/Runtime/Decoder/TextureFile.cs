using System.Collections.Generic;
using System.IO;
using System.Text;

namespace Meshreel
{
    /// <summary>
    /// Writes the H.264 pictures of a part's texture as an MP4 file, which a video player of the engine decodes. Its clock
    /// is that of the recording, from 0 at the first frame.
    /// </summary>
    public static class TextureFile
    {
        const uint TimeScale = 90000; // 1/s
        const int Sps = 7, Pps = 8, Idr = 5; // types of units

        sealed class Sample
        {
            public uint Size, Time, Duration;
            public bool IsKey;
        }

        /// <summary>
        /// Write the texture of a track or of the background to a file that can seek. Return false, without a byte written,
        /// where it has no pictures in H.264: `meshreel encode --compatible` makes them. Throws MeshreelException where the
        /// size of the texture changes, or where pictures that others need are of hidden frames.
        /// </summary>
        public static bool Write(Video video, int part, Stream file)
        {
            var samples = new List<Sample>();
            byte[] sps = null, pps = null;
            Picture first = default(Picture), last = default(Picture);
            var start = file.Position;
            for (var frame = 0; frame < video.FrameCount; ++frame)
            {
                if (!video.TryPicture(frame, part, Codec.H264, out var picture)) continue;
                if (samples.Count > 0 && picture.Stream == last.Stream && picture.Number == last.Number) continue;
                Check(video, frame, picture, samples.Count > 0 ? last : picture, samples.Count == 0);
                if (samples.Count == 0)
                {
                    first = picture;
                    WriteHead(file);
                }
                var sample = new Sample { Time = samples.Count == 0 ? 0 : Ticks(video.TimeOf(frame)) };
                WriteUnits(file, picture.Data, sample, ref sps, ref pps);
                samples.Add(sample);
                last = picture;
            }
            if (samples.Count == 0) return false;
            if (sps == null || sps.Length < 4 || pps == null)
                throw new MeshreelException(video.Name + ": pictures of H.264 without parameter sets", true);
            var end = Ticks(video.Duration);
            for (var k = 0; k < samples.Count; ++k)
                samples[k].Duration = (k + 1 < samples.Count ? samples[k + 1].Time : System.Math.Max(end, samples[k].Time + 1)) - samples[k].Time;
            WriteTail(file, start, samples, Movie(samples, first, sps, pps, (uint)start + 24 + 16));
            return true;
        }

        static void Check(Video video, int frame, Picture picture, Picture last, bool isFirst)
        {
            if (picture.Width != last.Width || picture.Height != last.Height)
                throw new MeshreelException($"{video.Name}: from frame {frame} on the texture is {picture.Width}x{picture.Height}"
                    + $" pixels, before it is {last.Width}x{last.Height}: encode the recording with one --texture size");
            var isNext = picture.Number == (isFirst || picture.Stream != last.Stream ? 0 : last.Number + 1);
            if (!isNext)
                throw new MeshreelException($"{video.Name}: the texture of frame {frame} needs pictures of frames that are"
                    + " hidden: play the file that was not cut");
        }

        static uint Ticks(double seconds)
        {
            return (uint)System.Math.Round(seconds * TimeScale);
        }

        // The sample's units with their lengths in place of start codes.
        static void WriteUnits(Stream file, byte[] data, Sample sample, ref byte[] sps, ref byte[] pps)
        {
            for (int at = After(data, 0, out _), next; at < data.Length; at = next)
            {
                next = After(data, at, out var end);
                while (end > at && data[end - 1] == 0) --end; // of a start code of four bytes
                if (end == at) continue;
                var kind = data[at] & 31;
                if (kind == Sps && sps == null) sps = Slice(data, at, end);
                if (kind == Pps && pps == null) pps = Slice(data, at, end);
                sample.IsKey |= kind == Idr;
                sample.Size += (uint)(4 + end - at);
                file.Write(Number(4, (uint)(end - at)), 0, 4);
                file.Write(data, at, end - at);
            }
        }

        // Where the first unit after `from` begins, and where the bytes before its start code end.
        static int After(byte[] data, int from, out int end)
        {
            for (var k = from; k + 2 < data.Length; ++k)
                if (data[k] == 0 && data[k + 1] == 0 && data[k + 2] == 1)
                {
                    end = k;
                    return k + 3;
                }
            end = data.Length;
            return data.Length;
        }

        static byte[] Slice(byte[] data, int from, int end)
        {
            var part = new byte[end - from];
            System.Array.Copy(data, from, part, 0, part.Length);
            return part;
        }

        // 24 bytes, and the head of the box of samples, whose size is known at the end.
        static void WriteHead(Stream file)
        {
            var type = Box("ftyp", Encoding.ASCII.GetBytes("isom"), Number(4, 512), Encoding.ASCII.GetBytes("isommp41"));
            file.Write(type, 0, type.Length);
            file.Write(Join(Number(4, 1), Encoding.ASCII.GetBytes("mdat"), Number(8, 0)), 0, 16);
        }

        static void WriteTail(Stream file, long start, List<Sample> samples, byte[] movie)
        {
            var end = file.Position;
            file.Write(movie, 0, movie.Length);
            file.Position = start + 24 + 8;
            file.Write(Number(8, (ulong)(end - start - 24)), 0, 8);
            file.Position = end + movie.Length;
        }

        static byte[] Movie(List<Sample> samples, Picture picture, byte[] sps, byte[] pps, uint offset)
        {
            var last = samples[samples.Count - 1];
            byte[] duration = Number(4, last.Time + last.Duration), scale = Number(4, TimeScale), one = Number(4, 1);
            byte[] matrix = Join(Number(4, 0x10000), Number(12, 0), Number(4, 0x10000), Number(12, 0), Number(4, 0x40000000));
            byte[] width = Number(2, (uint)picture.Width), height = Number(2, (uint)picture.Height);
            var movie = Box("mvhd", Number(12, 0), scale, duration, Number(4, 0x10000), Number(2, 0x100), Number(10, 0), matrix,
                Number(24, 0), Number(4, 2));
            var track = Box("tkhd", Number(4, 3), Number(8, 0), one, Number(4, 0), duration, Number(16, 0), matrix,
                width, Number(2, 0), height, Number(2, 0));
            var media = Box("mdhd", Number(12, 0), scale, duration, Number(2, 0x55c4), Number(2, 0));
            var kind = Box("hdlr", Number(8, 0), Encoding.ASCII.GetBytes("vide"), Number(13, 0));
            var config = Box("avcC", new byte[] { 1, sps[1], sps[2], sps[3], 0xff, 0xe1 }, Number(2, (uint)sps.Length), sps,
                new byte[] { 1 }, Number(2, (uint)pps.Length), pps);
            var entry = Box("avc1", Number(6, 0), Number(2, 1), Number(16, 0), width, height, Number(4, 0x480000),
                Number(4, 0x480000), Number(4, 0), Number(2, 1), Number(32, 0), Number(2, 24), Number(2, 0xffff), config);
            var table = Box("stbl", Box("stsd", Number(4, 0), one, entry),
                Table("stts", samples, s => Join(one, Number(4, s.Duration))),
                Keys(samples),
                Box("stsc", Number(4, 0), one, one, Number(4, (uint)samples.Count), one),
                Box("stsz", Number(8, 0), Number(4, (uint)samples.Count), Join(samples.ConvertAll(s => Number(4, s.Size)).ToArray())),
                Box("stco", Number(4, 0), one, Number(4, offset)));
            var data = Box("dinf", Box("dref", Number(4, 0), one, Box("url ", Number(4, 1))));
            var info = Box("minf", Box("vmhd", Number(4, 1), Number(8, 0)), data, table);
            return Box("moov", movie, Box("trak", track, Box("mdia", media, kind, info)));
        }

        static byte[] Keys(List<Sample> samples)
        {
            var keys = new List<byte[]>();
            for (var k = 0; k < samples.Count; ++k)
                if (samples[k].IsKey) keys.Add(Number(4, (uint)k + 1));
            return Box("stss", Number(4, 0), Number(4, (uint)keys.Count), Join(keys.ToArray()));
        }

        static byte[] Table(string name, List<Sample> samples, System.Converter<Sample, byte[]> row)
        {
            return Box(name, Number(4, 0), Number(4, (uint)samples.Count), Join(samples.ConvertAll(row).ToArray()));
        }

        static byte[] Box(string name, params byte[][] parts)
        {
            var body = Join(parts);
            return Join(Number(4, (uint)body.Length + 8), Encoding.ASCII.GetBytes(name), body);
        }

        static byte[] Join(params byte[][] parts)
        {
            var joined = new MemoryStream();
            foreach (var part in parts) joined.Write(part, 0, part.Length);
            return joined.ToArray();
        }

        static byte[] Number(int size, ulong value)
        {
            var bytes = new byte[size];
            for (var k = size - 1; k >= 0 && value > 0; --k, value >>= 8) bytes[k] = (byte)value;
            return bytes;
        }
    }
}
