// Runs the player's component in the stand-in for Unity: Play.exe FILE FOLDER LOOP OUT TIME..., and writes the mesh that it shows after
// each step of time.
using System;
using System.IO;
using System.Reflection;
using Meshreel;
using UnityEngine;

static class Play
{
    static void Main(string[] given)
    {
        Application.streamingAssetsPath = Path.GetDirectoryName(given[0]);
        Application.temporaryCachePath = given[1];
        var player = new GameObject().AddComponent<MeshreelPlayer>();
        player.loop = given[2] == "loop";
        if (given[0].EndsWith(".bytes")) player.asset = new TextAsset { name = "asset", bytes = File.ReadAllBytes(given[0]) };
        else player.path = Path.GetFileName(given[0]);
        Call(player, "OnEnable");
        var pictures = player.GetComponent<UnityEngine.Video.VideoPlayer>();
        if (pictures.url != null)
        {
            Console.WriteLine("texture " + File.Exists(pictures.url));
            pictures.isPrepared = true;
            pictures.texture = new Texture();
        }
        using (var output = new BinaryWriter(new FileStream(given[3], FileMode.Create)))
            for (var k = 4; k < given.Length; ++k)
            {
                Time.deltaTime = float.Parse(given[k]);
                pictures.time += Time.deltaTime;
                Call(player, "Update");
                Console.WriteLine("frame " + player.Frame);
                if (player.Video != null) Write(player.GetComponent<MeshFilter>().sharedMesh, output);
            }
        var source = player.GetComponent<AudioSource>();
        if (source.clip != null) Console.WriteLine($"audio {source.isPlaying} {source.time:R}");
        var material = player.GetComponent<MeshRenderer>().sharedMaterial;
        if (material != null) Console.WriteLine($"material {material.Numbers["_HasColors"]} {material.Numbers["_HasTexture"]}");
        Call(player, "OnDisable");
        Call(player, "OnEnable");
        Call(player, "OnDisable");
        Console.WriteLine("left " + Directory.GetFileSystemEntries(given[1]).Length);
        foreach (var told in Debug.Told) Console.WriteLine(told);
    }

    static void Call(object player, string name)
    {
        try
        {
            player.GetType().GetMethod(name, BindingFlags.Instance | BindingFlags.NonPublic).Invoke(player, null);
        }
        catch (TargetInvocationException error)
        {
            Console.WriteLine("thrown " + error.InnerException);
        }
    }

    static void Write(Mesh mesh, BinaryWriter output)
    {
        output.Write(mesh.Points.Length);
        output.Write(mesh.Indices.Length);
        foreach (var point in mesh.Points)
        {
            output.Write(point.x);
            output.Write(point.y);
            output.Write(point.z);
        }
        foreach (var index in mesh.Indices) output.Write(index);
    }
}
