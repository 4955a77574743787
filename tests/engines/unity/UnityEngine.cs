// A stand-in for what the player's component calls of Unity: meshes keep what they are given, clocks are set by the test.
using System;
using System.Collections;
using System.Collections.Generic;

namespace UnityEngine
{
    public class Object
    {
        public string name { get; set; }
        public static int Destroyed;
        public static void Destroy(Object made) { ++Destroyed; }
    }

    public class Component : Object
    {
        public GameObject gameObject;
        public T GetComponent<T>() where T : Component, new() { return gameObject.GetComponent<T>(); }
    }

    public class Behaviour : Component { }

    public class MonoBehaviour : Behaviour
    {
        public void StartCoroutine(IEnumerator routine) { while (routine.MoveNext()) { } }
    }

    public class GameObject : Object
    {
        readonly Dictionary<Type, Component> components = new Dictionary<Type, Component>();
        public T AddComponent<T>() where T : Component, new()
        {
            var added = new T { gameObject = this };
            components[typeof(T)] = added;
            return added;
        }
        public T GetComponent<T>() where T : Component, new()
        {
            return components.TryGetValue(typeof(T), out var found) ? (T)found : AddComponent<T>();
        }
    }

    public struct Vector2 { public float x, y; }
    public struct Vector3 { public float x, y, z; }
    public struct Color32 { public byte r, g, b, a; }
    public enum MeshTopology { Triangles }

    public class Mesh : Object
    {
        public Rendering.IndexFormat indexFormat { get; set; }
        public Vector3[] Points;
        public Color32[] Colors;
        public Vector2[] Places;
        public int[] Indices;
        public int Normals;

        public void MarkDynamic() { }
        public void Clear() { Points = null; Colors = null; Places = null; Indices = null; }
        public void SetVertices(Vector3[] values, int start, int length) { Points = Part(values, start, length); }
        public void SetColors(Color32[] values, int start, int length) { Colors = Part(values, start, length); }
        public void SetUVs(int channel, Vector2[] values, int start, int length) { Places = Part(values, start, length); }
        public void SetIndices(int[] values, int start, int length, MeshTopology topology, int submesh)
        {
            Indices = Part(values, start, length);
        }
        public void RecalculateNormals() { ++Normals; }
        public void RecalculateBounds() { }

        static T[] Part<T>(T[] values, int start, int length)
        {
            var part = new T[length];
            Array.Copy(values, start, part, 0, length);
            return part;
        }
    }

    public class MeshFilter : Component { public Mesh sharedMesh { get; set; } }
    public class MeshRenderer : Component { public Material sharedMaterial { get; set; } }
    public class Shader : Object { }
    public class Texture : Object { }

    public class Material : Object
    {
        public readonly Dictionary<string, float> Numbers = new Dictionary<string, float>();
        public Texture mainTexture { get; set; }
        public Material(Shader shader) { if (shader == null) throw new ArgumentNullException(); }
        public void SetFloat(string name, float value) { Numbers[name] = value; }
    }

    public class TextAsset : Object { public byte[] bytes; }

    public static class Resources
    {
        public static T Load<T>(string name) where T : new() { return name == "Meshreel" ? new T() : default(T); }
    }

    public static class Application
    {
        public static string streamingAssetsPath, temporaryCachePath;
    }

    public static class Time { public static float deltaTime; }

    public static class Debug
    {
        public static readonly List<string> Told = new List<string>();
        public static void LogWarning(object message, Object context) { Told.Add("warning: " + message); }
        public static void LogError(object message, Object context) { Told.Add("error: " + message); }
    }

    public enum AudioType { MPEG }
    public class AudioClip : Object { public float length; }

    public class AudioSource : Behaviour
    {
        public AudioClip clip { get; set; }
        public bool isPlaying { get; set; }
        public float time { get; set; }
        public void Play() { isPlaying = true; }
        public void Stop() { isPlaying = false; }
    }

    [AttributeUsage(AttributeTargets.Class)]
    public class AddComponentMenu : Attribute { public AddComponentMenu(string name) { } }
    [AttributeUsage(AttributeTargets.Class)]
    public class RequireComponent : Attribute { public RequireComponent(Type first, Type second) { } }
    [AttributeUsage(AttributeTargets.Field)]
    public class TooltipAttribute : Attribute { public TooltipAttribute(string text) { } }
}

namespace UnityEngine.Rendering
{
    public enum IndexFormat { UInt16, UInt32 }
}

namespace UnityEngine.Video
{
    public enum VideoRenderMode { APIOnly }
    public enum VideoAudioOutputMode { None }

    public class VideoPlayer : Behaviour
    {
        public VideoRenderMode renderMode { get; set; }
        public VideoAudioOutputMode audioOutputMode { get; set; }
        public bool isLooping { get; set; }
        public string url { get; set; }
        public bool isPrepared { get; set; }
        public double time { get; set; }
        public Texture texture { get; set; }
        public void Play() { }
    }
}

namespace UnityEngine.Networking
{
    public class UnityWebRequest : IDisposable
    {
        public enum Result { Success, ConnectionError }
        public Result result { get { return System.IO.File.Exists(Path) ? Result.Success : Result.ConnectionError; } }
        public string error { get { return "no file " + Path; } }
        internal string Path;
        public object SendWebRequest() { return null; }
        public void Dispose() { }
    }

    public static class UnityWebRequestMultimedia
    {
        public static UnityWebRequest GetAudioClip(string url, AudioType type)
        {
            return new UnityWebRequest { Path = new Uri(url).LocalPath };
        }
    }

    public static class DownloadHandlerAudioClip
    {
        public static AudioClip GetContent(UnityWebRequest request) { return new AudioClip { length = 1 }; }
    }
}
