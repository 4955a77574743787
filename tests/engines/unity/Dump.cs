// Calls the decoder's wrapper and writes what it gives as bytes, for the test that compares them with Python's:
//   Dump.exe surfaces FILE OUT LAYERS | picture FILE OUT FRAME PART CODEC | texture FILE OUT PART | audio FILE OUT
//   | splats FILE OUT FRAME | facts FILE | errors FILE | memory FILE
using System;
using System.IO;
using Meshreel;

static unsafe class Dump
{
    static int Main(string[] given)
    {
        try
        {
            Run(given);
            return 0;
        }
        catch (MeshreelException error)
        {
            Console.WriteLine((error.IsDamaged ? "damaged: " : "") + error.Message);
            return 1;
        }
    }

    static void Run(string[] given)
    {
        using (var video = Video.Open(given[1]))
        {
            if (given[0] == "facts") Facts(video);
            else if (given[0] == "errors") Errors(video, given[1]);
            else if (given[0] == "memory") Memory(video);
            else
                using (var file = new FileStream(given[2], FileMode.Create))
                using (var output = new BinaryWriter(file))
                    if (given[0] == "surfaces") Surfaces(video, output, int.Parse(given[3]));
                    else if (given[0] == "texture") Console.WriteLine(TextureFile.Write(video, int.Parse(given[3]), file));
                    else if (given[0] == "picture") WritePicture(video, output, given);
                    else if (given[0] == "audio") WriteAudio(video, output);
                    else WriteSplats(video, output, int.Parse(given[3]));
        }
    }

    static void Facts(Video video)
    {
        video.GetOrigin(out var x, out var y, out var z);
        Console.WriteLine($"{video.FrameCount} {video.FrameRate:R} {video.Duration:R} {video.TrackCount} {video.LayerCount} {(int)video.Up}");
        Console.WriteLine($"{video.HasBackground} {video.HasColors} {video.HasTextures} {video.HasSplats} {x:R} {y:R} {z:R}");
        Console.WriteLine(video.Metadata());
        for (var frame = 0; frame < video.FrameCount; ++frame)
        {
            var time = video.TimeOf(frame);
            var rounded = Math.Round(90000 * time) / 90000; // as texture files have it
            Console.WriteLine($"{time:R} {video.FrameAt(time)} {video.FrameAt(time - 1e-4)} {video.FrameAt(time + 1e-4)} {video.FrameAt(rounded)}");
        }
    }

    static void Surfaces(Video video, BinaryWriter output, int layers)
    {
        video.SetLayers(layers);
        for (var part = Video.Background; part < video.TrackCount; ++part)
        {
            var surface = new Surface();
            for (var frame = 0; frame < video.FrameCount; ++frame)
            {
                video.Decode(frame, part, surface);
                int vertices = surface.VertexCount, indices = surface.IndexCount;
                foreach (var number in new[] { vertices, indices, surface.HasColors ? 1 : 0, surface.HasUv ? 1 : 0, surface.IsNew ? 1 : 0 })
                    output.Write(number);
                var bytes = new byte[12 * vertices + 4 * indices + (surface.HasColors ? 4 * vertices : 0) + (surface.HasUv ? 8 * vertices : 0) + 1];
                fixed (byte* start = bytes)
                {
                    var at = start;
                    surface.CopyPositions((float*)at);
                    at += 12 * vertices;
                    surface.CopyIndices((int*)at);
                    at += 4 * indices;
                    if (surface.HasColors) surface.CopyColors(at);
                    at += surface.HasColors ? 4 * vertices : 0;
                    if (surface.HasUv) surface.CopyUv((float*)at);
                }
                output.Write(bytes, 0, bytes.Length - 1);
            }
        }
    }

    static void WritePicture(Video video, BinaryWriter output, string[] given)
    {
        if (!video.TryPicture(int.Parse(given[3]), int.Parse(given[4]), (Codec)int.Parse(given[5]), out var picture)) return;
        Console.WriteLine($"{picture.Number} {picture.Width} {picture.Height}");
        output.Write(picture.Data);
    }

    static void WriteAudio(Video video, BinaryWriter output)
    {
        var sound = video.Audio();
        if (sound == null) return;
        Console.WriteLine($"{sound.Type} {sound.Start:R}");
        output.Write(sound.Data);
    }

    static void WriteSplats(Video video, BinaryWriter output, int frame)
    {
        var splats = video.Splats(frame, 0);
        for (ulong k = 0; k < 3 * splats.Count; ++k) output.Write(splats.Means[k]);
        for (ulong k = 0; k < 9 * splats.Count; ++k) output.Write(splats.Axes[k]);
        for (ulong k = 0; k < 3 * splats.Count; ++k) output.Write(splats.Scales[k]);
        for (ulong k = 0; k < splats.Count; ++k) output.Write(splats.Opacities[k]);
        for (ulong k = 0; k < 3 * splats.Count; ++k) output.Write(splats.Colors[k]);
    }

    static void Errors(Video video, string path)
    {
        var surface = new Surface();
        Try(() => surface.CopyPositions(null));
        video.Decode(0, 0, surface);
        video.Decode(0, 0, new Surface());
        Try(() => surface.CopyIndices(null));
        Try(() => video.Decode(video.FrameCount, 0, surface));
        Try(() => video.Decode(0, 99, surface));
        Try(() => video.SetLayers(-2));
        Try(() => Video.Open(new byte[] { 1, 2 }, "two bytes"));
        Try(() => Video.Open(path + ".none"));
        var bytes = File.ReadAllBytes(path);
        Try(() => Video.Open(new Failing(bytes), "a stream").Decode(0, 0, surface));
        using (var whole = Video.Open(bytes, "in memory")) whole.Decode(0, 0, surface);
        video.Dispose();
        video.Dispose();
        Try(() => video.Decode(0, 0, surface));
        for (var k = 0; k < 50; ++k) Video.Open(bytes, "not disposed").Decode(0, 0, surface);
        GC.Collect();
        GC.WaitForPendingFinalizers();
    }

    static void Try(Action call)
    {
        try
        {
            call();
            Console.WriteLine("no error");
        }
        catch (Exception error)
        {
            Console.WriteLine($"{error.GetType().Name}: {error.Message.Split('\n')[0]}: {error.InnerException?.Message}");
        }
    }

    // A stream whose first bytes, the head, can be read and no others.
    sealed class Failing : MemoryStream
    {
        public Failing(byte[] bytes) : base(bytes) { }
        bool began;
        public override int Read(byte[] buffer, int offset, int count)
        {
            if (began) throw new IOException("the disk is gone");
            began = true;
            return base.Read(buffer, offset, count);
        }
    }

    // Frames whose faces stay take no managed memory.
    static void Memory(Video video)
    {
        var surface = new Surface();
        var positions = new float[1 << 20];
        long before = 0;
        for (var k = 0; k < 200; ++k)
        {
            if (k == 100) before = GC.GetAllocatedBytesForCurrentThread();
            video.Decode(video.FrameAt(k % 4 * 0.02), 0, surface);
            fixed (float* output = positions) surface.CopyPositions(output);
        }
        Console.WriteLine(GC.GetAllocatedBytesForCurrentThread() - before);
    }
}
