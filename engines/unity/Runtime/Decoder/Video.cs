using System;
using System.IO;
using System.Runtime.InteropServices;
using System.Text;

namespace Meshreel
{
    /// <summary>A call that failed, and why in words.</summary>
    public sealed class MeshreelException : IOException
    {
        /// <summary>True where the bytes of a frame are damaged: other frames may be whole.</summary>
        public readonly bool IsDamaged;

        public MeshreelException(string message, bool isDamaged = false, Exception cause = null) : base(message, cause)
        {
            IsDamaged = isDamaged;
        }
    }

    /// <summary>The axis of a recording that points up.</summary>
    public enum Up { Y, Z, MinusY, MinusZ }

    /// <summary>Codings of a texture's pictures.</summary>
    public enum Codec { Av1 = 1, H264 = 2 }

    /// <summary>Types of audio files: Opus in Ogg or WebM, AAC in MP4 or ADTS, MP3.</summary>
    public enum SoundType { Ogg = 1, WebM, Mp4, Adts, Mpeg }

    /// <summary>A coded picture: it is shown once all pictures of its stream before it have been decoded, in order.</summary>
    public struct Picture
    {
        public byte[] Data; // AV1: a temporal unit; H.264: an access unit with start codes
        public ulong Stream; // a decoder begins anew where it is another
        public int Number; // in its stream, from 0
        public int Width, Height;
    }

    /// <summary>The audio file of a recording.</summary>
    public sealed class Sound
    {
        public byte[] Data;
        public double Start; // s after frame 0; below 0: its beginning is skipped
        public SoundType Type;
    }

    /// <summary>Flat Gaussians in the recording's axes, in memory of the library: valid until the next call of their video.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public unsafe struct Splats
    {
        public ulong Count;
        public double* Means; // three of each, m
        public double* Axes; // nine: three unit vectors
        public double* Scales; // three, along these, m
        public double* Opacities; // one, 0 to 1
        public double* Colors; // three, sRGB, 0 to 1
    }

    /// <summary>
    /// A .reel file that is open. One thread at a time may use it; open a file twice to decode it by two. Calls throw
    /// MeshreelException where bytes are damaged or cannot be read, and ObjectDisposedException after Dispose.
    /// </summary>
    public sealed unsafe class Video : IDisposable
    {
        /// <summary>Parts of a frame besides tracks, which have numbers from 0.</summary>
        public const int Whole = -1, Background = -2;

        const double Close = 1e-5; // s: times in files are whole microseconds, those of texture files 90,000ths
        internal int Turn { get; private set; } // grows with each call after which earlier meshes are gone
        readonly VideoHandle handle;
        readonly StreamReader reader; // null: all bytes are in memory
        Native.Info info;

        /// <summary>Open a file, which is read by ranges as frames need them.</summary>
        public static Video Open(string path)
        {
            return Open(new FileStream(path, FileMode.Open, FileAccess.Read, FileShare.Read), path);
        }

        /// <summary>Open a stream that can seek, and that the video closes; `name` begins the messages of errors.</summary>
        public static Video Open(Stream stream, string name)
        {
            try
            {
                return new Video(new StreamReader(stream), null, name);
            }
            catch
            {
                stream.Dispose();
                throw;
            }
        }

        /// <summary>Open a file in memory, which is not copied and must not be changed.</summary>
        public static Video Open(byte[] bytes, string name)
        {
            return new Video(null, bytes, name);
        }

        Video(StreamReader reader, byte[] bytes, string name)
        {
            if (Native.meshreel_abi_version() != Native.AbiVersion)
                throw new MeshreelException("the native library meshreel is of another version than this package");
            this.reader = reader;
            Name = name;
            var source = reader == null ? GCHandle.Alloc(bytes, GCHandleType.Pinned) : GCHandle.Alloc(reader);
            var status = reader == null
                ? Native.meshreel_open_memory((byte*)source.AddrOfPinnedObject(), (ulong)bytes.Length, out handle)
                : Native.meshreel_open(StreamReader.Read, GCHandle.ToIntPtr(source), (ulong)reader.Stream.Length, out handle);
            handle.Source = source;
            try
            {
                Check(status);
                Check(Native.meshreel_get_info(handle, out info));
            }
            catch
            {
                handle.Dispose();
                throw;
            }
        }

        public void Dispose()
        {
            ++Turn;
            handle.Dispose();
            reader?.Stream.Dispose();
        }

        public string Name { get; }
        public int FrameCount => (int)info.Frames;
        public double FrameRate => info.FrameRate; // 1/s
        public double Duration => info.Duration; // s
        public int TrackCount => (int)info.Tracks; // moving bodies
        public int LayerCount => (int)info.Layers; // the most that a group has beyond its first
        public Up Up => (Up)info.Up;
        public bool HasBackground => info.HasBackground != 0;
        public bool HasColors => info.HasColors != 0;
        public bool HasTextures => info.HasTextures != 0;
        public bool HasSplats => info.HasSplats != 0;

        /// <summary>The place that surfaces are about, in the recording's axes, m.</summary>
        public void GetOrigin(out double x, out double y, out double z)
        {
            x = Origin(0);
            y = Origin(1);
            z = Origin(2);
        }

        /// <summary>Return the encoder's metadata, a JSON object.</summary>
        public string Metadata()
        {
            return Text(Native.meshreel_metadata(handle));
        }

        /// <summary>Return when a frame is shown, s after the first.</summary>
        public double TimeOf(int frame)
        {
            ++Turn;
            Check(Native.meshreel_time(handle, (ulong)frame, out var seconds));
            Check(Native.meshreel_time(handle, 0, out var first));
            return seconds - first;
        }

        /// <summary>Return the frame that is shown some seconds after the first frame began; the ends hold.</summary>
        public int FrameAt(double seconds)
        {
            int low = 0, high = FrameCount;
            while (high - low > 1)
            {
                var middle = (low + high) / 2;
                if (TimeOf(middle) <= seconds + Close) low = middle;
                else high = middle;
            }
            return low;
        }

        /// <summary>Decode from at most so many layers of each group beyond its first; -1: from all.</summary>
        public void SetLayers(int layers)
        {
            ++Turn;
            Check(Native.meshreel_set_layers(handle, layers));
        }

        /// <summary>Decode a part of a frame. The surface can be copied until the next call of this video.</summary>
        /// <returns>What was left out, such as damaged colours, in words; else null.</returns>
        public string Decode(int frame, int part, Surface surface)
        {
            ++Turn;
            Check(Native.meshreel_decode(handle, (ulong)frame, part, out var mesh));
            var lacking = Native.meshreel_last_error(handle);
            surface.Take(this, part, mesh);
            return *lacking == 0 ? null : Text(lacking);
        }

        /// <summary>Return the coded picture of a part's texture in a frame; false where there is none.</summary>
        public bool TryPicture(int frame, int part, Codec codec, out Picture picture)
        {
            ++Turn;
            Check(Native.meshreel_picture(handle, (ulong)frame, part, (int)codec, out var packet));
            picture = new Picture
            {
                Data = Bytes(packet.Data, packet.Size), Stream = packet.Stream, Number = (int)packet.Number,
                Width = (int)packet.Width, Height = (int)packet.Height,
            };
            return packet.Data != null;
        }

        /// <summary>Return the audio file, or null.</summary>
        public Sound Audio()
        {
            ++Turn;
            Check(Native.meshreel_audio(handle, out var sound));
            if (sound.Data == null) return null;
            return new Sound { Data = Bytes(sound.Data, sound.Size), Start = sound.Start, Type = (SoundType)sound.Type };
        }

        /// <summary>Return the splats of a track in a frame, which are drawn in place of its surface.</summary>
        public Splats Splats(int frame, int track)
        {
            ++Turn;
            Check(Native.meshreel_decode_splats(handle, (ulong)frame, track, out var splats));
            return splats;
        }

        internal double Origin(int axis)
        {
            fixed (double* origin = info.Origin) return origin[axis];
        }

        void Check(int status)
        {
            if (status == Native.Ok) return;
            var message = Name + ": " + Text(Native.meshreel_last_error(handle));
            throw new MeshreelException(message, status == Native.Damaged, reader?.Failure);
        }

        static byte[] Bytes(byte* data, ulong size)
        {
            var copy = new byte[size];
            if (size > 0) Marshal.Copy((IntPtr)data, copy, 0, copy.Length);
            return copy;
        }

        static string Text(byte* text)
        {
            var length = 0;
            while (text[length] != 0) ++length;
            return Encoding.UTF8.GetString(text, length);
        }
    }
}
