using System;
using System.Collections.Generic;

namespace Meshreel
{
    /// <summary>
    /// A part of a frame as Unity draws it: y up, left-handed, clockwise faces, places in the texture by vertex. Positions
    /// are in metres about the recording's origin. Use one for each part that is shown: its buffers are used again, so that
    /// frames whose faces stay take no memory.
    /// </summary>
    public sealed unsafe class Surface
    {
        const float Nowhere = -1; // in place of NaN, which shaders need not know

        // By the axis that points up: the recording's axes that become y and z, and their signs; x changes its sign.
        static readonly int[] Second = { 1, 2, 1, 2 }, Third = { 2, 1, 2, 1 };
        static readonly int[] SecondSign = { 1, 1, -1, -1 }, ThirdSign = { 1, -1, -1, 1 };

        Video video;
        int part, turn;
        Native.Mesh mesh;
        int[] corners = new int[0]; // of faces, numbers of vertices
        int[] sources = new int[0]; // of each vertex, its number in the file
        float[] places = new float[0]; // two of each vertex
        readonly Dictionary<(int, float, float), int> split = new Dictionary<(int, float, float), int>();

        public int VertexCount { get; private set; }
        public int IndexCount => 3 * (int)mesh.FaceCount;
        public bool HasColors => mesh.Colors != null;
        public bool HasUv => mesh.Uv != null;

        /// <summary>True where faces and places are others than those that were decoded before.</summary>
        public bool IsNew { get; private set; }

        internal void Take(Video from, int of, Native.Mesh decoded)
        {
            IsNew = video != from || part != of || mesh.Identity != decoded.Identity || HasUv != (decoded.Uv != null);
            video = from;
            part = of;
            turn = from.Turn;
            mesh = decoded;
            if (!IsNew) return;
            VertexCount = (int)mesh.VertexCount;
            if (HasUv) Split();
        }

        /// <summary>Write three numbers for each vertex.</summary>
        public void CopyPositions(float* output)
        {
            Check();
            var up = (int)video.Up;
            int second = Second[up], third = Third[up], secondSign = SecondSign[up], thirdSign = ThirdSign[up];
            double x = video.Origin(0), y = video.Origin(second), z = video.Origin(third);
            for (var v = 0; v < VertexCount; ++v, output += 3)
            {
                var position = mesh.Positions + 3 * (HasUv ? sources[v] : v);
                output[0] = -(float)(position[0] - x);
                output[1] = secondSign * (float)(position[second] - y);
                output[2] = thirdSign * (float)(position[third] - z);
            }
        }

        /// <summary>Write red, green, blue and 255 for each vertex, sRGB.</summary>
        public void CopyColors(byte* output)
        {
            Check();
            for (var v = 0; v < VertexCount; ++v, output += 4)
            {
                var color = mesh.Colors + 3 * (HasUv ? sources[v] : v);
                output[0] = color[0];
                output[1] = color[1];
                output[2] = color[2];
                output[3] = 255;
            }
        }

        /// <summary>Write right and up, 0 to 1, for each vertex; -1 where its faces show the colours of vertices.</summary>
        public void CopyUv(float* output)
        {
            Check();
            for (var k = 0; k < 2 * VertexCount; ++k) output[k] = places[k];
        }

        /// <summary>Write three vertices for each face.</summary>
        public void CopyIndices(int* output)
        {
            Check();
            for (var c = 0; c < IndexCount; c += 3)
            {
                output[c] = Vertex(c);
                output[c + 1] = Vertex(c + 2);
                output[c + 2] = Vertex(c + 1);
            }
        }

        int Vertex(int corner)
        {
            return HasUv ? corners[corner] : mesh.Faces[corner];
        }

        // Corners that have one vertex and one place become one vertex.
        void Split()
        {
            split.Clear();
            Grow(ref corners, IndexCount);
            for (var c = 0; c < IndexCount; ++c)
            {
                float u = mesh.Uv[2 * c], v = mesh.Uv[2 * c + 1];
                if (float.IsNaN(u) || float.IsNaN(v)) u = v = Nowhere;
                var key = (mesh.Faces[c], u, v);
                if (!split.TryGetValue(key, out corners[c])) split[key] = corners[c] = split.Count;
            }
            VertexCount = split.Count;
            Grow(ref sources, VertexCount);
            Grow(ref places, 2 * VertexCount);
            foreach (var entry in split)
            {
                sources[entry.Value] = entry.Key.Item1;
                places[2 * entry.Value] = entry.Key.Item2;
                places[2 * entry.Value + 1] = entry.Key.Item3;
            }
        }

        static void Grow<T>(ref T[] array, int count)
        {
            if (array.Length < count) array = new T[Math.Max(count, array.Length + array.Length / 2)];
        }

        void Check()
        {
            if (video == null || turn != video.Turn)
                throw new InvalidOperationException("the surface is gone: copy it before the next call of its video");
        }
    }
}
