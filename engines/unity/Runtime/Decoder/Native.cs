using System;
using System.IO;
using System.Runtime.InteropServices;

namespace Meshreel
{
    /// <summary>The calls of meshreel/decoder.h.</summary>
    static unsafe class Native
    {
#if UNITY_IOS && !UNITY_EDITOR
        const string Library = "__Internal"; // the static library is linked
#else
        const string Library = "meshreel";
#endif
        const CallingConvention C = CallingConvention.Cdecl;
        public const uint AbiVersion = 1;
        public const int Ok = 0, BadArgument = 1, Damaged = 2, Unreadable = 3, NoMemory = 4;

        [UnmanagedFunctionPointer(C)]
        public delegate long Read(IntPtr context, ulong offset, ulong length, byte* output);

        [StructLayout(LayoutKind.Sequential)]
        public struct Info
        {
            public ulong Frames;
            public double FrameRate, Duration;
            public fixed double Origin[3];
            public double Scale;
            public fixed double Minimum[3], Maximum[3];
            public uint Tracks, Layers;
            public int Up;
            public byte HasBackground, HasColors, HasTextures, HasSplats;
        }

        [StructLayout(LayoutKind.Sequential)]
        public struct Mesh
        {
            public ulong VertexCount, FaceCount;
            public double* Positions;
            public int* Faces;
            public byte* Colors;
            public float* Uv;
            public ulong Identity;
        }

        [StructLayout(LayoutKind.Sequential)]
        public struct Packet
        {
            public byte* Data;
            public ulong Size, Stream, Number;
            public uint Width, Height;
        }

        [StructLayout(LayoutKind.Sequential)]
        public struct Sound
        {
            public byte* Data;
            public ulong Size;
            public double Start;
            public int Type;
        }

        [DllImport(Library, CallingConvention = C)]
        public static extern uint meshreel_abi_version();
        [DllImport(Library, CallingConvention = C)]
        public static extern int meshreel_open(Read read, IntPtr context, ulong size, out VideoHandle video);
        [DllImport(Library, CallingConvention = C)]
        public static extern int meshreel_open_memory(byte* data, ulong size, out VideoHandle video);
        [DllImport(Library, CallingConvention = C)]
        public static extern void meshreel_close(IntPtr video);
        [DllImport(Library, CallingConvention = C)]
        public static extern byte* meshreel_last_error(VideoHandle video);
        [DllImport(Library, CallingConvention = C)]
        public static extern int meshreel_get_info(VideoHandle video, out Info info);
        [DllImport(Library, CallingConvention = C)]
        public static extern int meshreel_time(VideoHandle video, ulong frame, out double seconds);
        [DllImport(Library, CallingConvention = C)]
        public static extern byte* meshreel_metadata(VideoHandle video);
        [DllImport(Library, CallingConvention = C)]
        public static extern int meshreel_set_layers(VideoHandle video, int layers);
        [DllImport(Library, CallingConvention = C)]
        public static extern int meshreel_decode(VideoHandle video, ulong frame, int part, out Mesh mesh);
        [DllImport(Library, CallingConvention = C)]
        public static extern void meshreel_round(Mesh* mesh, double* about, float* output);
        [DllImport(Library, CallingConvention = C)]
        public static extern int meshreel_picture(VideoHandle video, ulong frame, int part, int codec, out Packet packet);
        [DllImport(Library, CallingConvention = C)]
        public static extern int meshreel_audio(VideoHandle video, out Sound sound);
        [DllImport(Library, CallingConvention = C)]
        public static extern int meshreel_decode_splats(VideoHandle video, ulong frame, int track, out Splats splats);
    }

    /// <summary>Owns an open file, and its bytes or the stream that it is read from.</summary>
    sealed class VideoHandle : SafeHandle
    {
        public GCHandle Source;

        public VideoHandle() : base(IntPtr.Zero, true)
        {
        }

        public override bool IsInvalid => handle == IntPtr.Zero;

        protected override bool ReleaseHandle()
        {
            Native.meshreel_close(handle);
            if (Source.IsAllocated) Source.Free();
            return true;
        }
    }

    /// <summary>Reads a stream by ranges for the library, which must never see an exception.</summary>
    sealed unsafe class StreamReader
    {
        public static readonly Native.Read Read = ReadRange; // kept alive: native code calls it
        public readonly Stream Stream;
        public Exception Failure;
        readonly byte[] buffer = new byte[1 << 16];

        public StreamReader(Stream stream)
        {
            Stream = stream;
        }

        [MonoPInvokeCallback(typeof(Native.Read))]
        static long ReadRange(IntPtr context, ulong offset, ulong length, byte* output)
        {
            var reader = (StreamReader)GCHandle.FromIntPtr(context).Target;
            try
            {
                reader.Failure = null;
                reader.Stream.Position = (long)offset;
                return reader.Copy((long)length, output);
            }
            catch (Exception failure)
            {
                reader.Failure = failure;
                return -1;
            }
        }

        long Copy(long length, byte* output)
        {
            long done = 0;
            while (done < length)
            {
                var count = Stream.Read(buffer, 0, (int)Math.Min(buffer.Length, length - done));
                if (count == 0) break;
                Marshal.Copy(buffer, 0, (IntPtr)(output + done), count);
                done += count;
            }
            return done;
        }
    }

    /// <summary>IL2CPP knows functions that native code calls by the name of this attribute.</summary>
    [AttributeUsage(AttributeTargets.Method)]
    sealed class MonoPInvokeCallbackAttribute : Attribute
    {
        public MonoPInvokeCallbackAttribute(Type type)
        {
        }
    }
}
