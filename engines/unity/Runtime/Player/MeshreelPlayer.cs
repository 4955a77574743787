using System.Collections;
using System.IO;
using UnityEngine;
using UnityEngine.Networking;
using UnityEngine.Rendering;
using UnityEngine.Video;

namespace Meshreel
{
    /// <summary>
    /// Shows a part of a recording as the mesh of this object: an asset, or a file. Its texture, which must have H.264
    /// pictures, is played by a VideoPlayer, whose clock frames then follow; its audio, which must be MP3, by an
    /// AudioSource.
    /// </summary>
    [AddComponentMenu("meshreel/Player")]
    [RequireComponent(typeof(MeshFilter), typeof(MeshRenderer))]
    public sealed unsafe class MeshreelPlayer : MonoBehaviour
    {
        const double MostApart = 0.1; // s of audio from the frames, before it is moved (guess)

        [Tooltip("The recording as an asset: name the file NAME.reel.bytes")]
        public TextAsset asset;
        [Tooltip("Or the path of the file; others than absolute ones are in StreamingAssets")]
        public string path;
        [Tooltip("A track from 0; -1: all parts in one mesh, without textures; -2: the background")]
        public int part = Video.Whole;
        [Tooltip("At most so many layers of detail beyond the first; -1: all")]
        public int layers = -1;
        public bool loop = true;
        public bool playAudio = true;

        /// <summary>The open recording, null until the component is enabled and where it cannot be opened.</summary>
        public Video Video { get; private set; }
        /// <summary>The frame that is shown; -1: none yet.</summary>
        public int Frame { get; private set; } = -1;

        readonly Surface surface = new Surface();
        Vector3[] points = new Vector3[0];
        Color32[] colors = new Color32[0];
        Vector2[] places = new Vector2[0];
        int[] indices = new int[0];
        Mesh mesh;
        Material material;
        VideoPlayer pictures; // null: without a texture
        AudioSource source;
        string folder; // of temporary files
        int shownPart;
        double seconds, audioStart;

        void OnEnable()
        {
            try
            {
                Video = asset != null ? Video.Open(asset.bytes, asset.name) : Video.Open(Path.Combine(Application.streamingAssetsPath, path));
                Video.SetLayers(layers);
                shownPart = part == Video.Whole && Video.TrackCount == 1 && !Video.HasBackground ? 0 : part;
                Prepare();
                Show(0);
            }
            catch (IOException error)
            {
                Debug.LogError(error.Message, this);
                OnDisable();
            }
        }

        void Prepare()
        {
            mesh = new Mesh { name = Video.Name, indexFormat = IndexFormat.UInt32 };
            mesh.MarkDynamic();
            GetComponent<MeshFilter>().sharedMesh = mesh;
            material = new Material(Resources.Load<Shader>("Meshreel"));
            GetComponent<MeshRenderer>().sharedMaterial = material;
            folder = Path.Combine(Application.temporaryCachePath, "meshreel-" + System.Guid.NewGuid().ToString("N"));
            Directory.CreateDirectory(folder);
            if (Video.HasTextures && shownPart != Video.Whole) PrepareTexture(Path.Combine(folder, "texture.mp4"));
            if (playAudio && Video.Audio() is Sound sound) PrepareAudio(sound);
        }

        void PrepareTexture(string file)
        {
            using (var stream = new FileStream(file, FileMode.Create))
                if (!TextureFile.Write(Video, shownPart, stream))
                {
                    Debug.LogWarning(Video.Name + ": no pictures in H.264; encode the recording with --compatible", this);
                    return;
                }
            pictures = gameObject.AddComponent<VideoPlayer>();
            pictures.renderMode = VideoRenderMode.APIOnly;
            pictures.audioOutputMode = VideoAudioOutputMode.None;
            pictures.isLooping = loop;
            pictures.url = file;
            pictures.Play();
        }

        void PrepareAudio(Sound sound)
        {
            if (sound.Type != SoundType.Mpeg)
            {
                Debug.LogWarning($"{Video.Name}: audio of type {sound.Type} is not played here; give the recording MP3", this);
                return;
            }
            var file = Path.Combine(folder, "audio.mp3");
            File.WriteAllBytes(file, sound.Data);
            audioStart = sound.Start;
            StartCoroutine(LoadAudio(new System.Uri(file).AbsoluteUri));
        }

        IEnumerator LoadAudio(string url)
        {
            using (var request = UnityWebRequestMultimedia.GetAudioClip(url, AudioType.MPEG))
            {
                yield return request.SendWebRequest();
                if (request.result != UnityWebRequest.Result.Success)
                {
                    Debug.LogWarning(Video.Name + ": audio: " + request.error, this);
                    yield break;
                }
                source = gameObject.AddComponent<AudioSource>();
                source.clip = DownloadHandlerAudioClip.GetContent(request);
            }
        }

        void Update()
        {
            if (Video == null) return;
            if (pictures != null)
            {
                if (pictures.isPrepared) seconds = pictures.time;
            }
            else
            {
                seconds += Time.deltaTime;
                if (loop && seconds >= Video.Duration) seconds %= Video.Duration;
            }
            try
            {
                Show(Video.FrameAt(seconds));
            }
            catch (MeshreelException error)
            {
                Debug.LogWarning(error.Message, this); // what was shown stays
            }
            ShowTexture();
            if (source != null) Follow(source, seconds - audioStart);
        }

        static void Follow(AudioSource source, double seconds)
        {
            var isHeard = seconds >= 0 && seconds < source.clip.length;
            if (isHeard && !source.isPlaying) source.Play();
            if (!isHeard && source.isPlaying) source.Stop();
            if (isHeard && System.Math.Abs(source.time - seconds) > MostApart) source.time = (float)seconds;
        }

        void Show(int frame)
        {
            if (frame == Frame) return;
            Frame = frame; // also of one that is damaged, which is not tried again
            Video.Decode(frame, shownPart, surface);
            var count = surface.VertexCount;
            if (surface.IsNew) mesh.Clear();
            Grow(ref points, count);
            fixed (Vector3* output = points) surface.CopyPositions((float*)output);
            mesh.SetVertices(points, 0, count);
            if (surface.HasColors)
            {
                Grow(ref colors, count);
                fixed (Color32* output = colors) surface.CopyColors((byte*)output);
                mesh.SetColors(colors, 0, count);
            }
            if (surface.IsNew) ShowFaces(count);
            if (!surface.HasColors) mesh.RecalculateNormals();
            mesh.RecalculateBounds();
            material.SetFloat("_HasColors", surface.HasColors ? 1 : 0);
        }

        // A texture is there some time after its player began.
        void ShowTexture()
        {
            var texture = pictures != null && surface.HasUv ? pictures.texture : null;
            material.SetFloat("_HasTexture", texture != null ? 1 : 0);
            if (texture != null) material.mainTexture = texture;
        }

        void ShowFaces(int count)
        {
            if (surface.HasUv)
            {
                Grow(ref places, count);
                fixed (Vector2* output = places) surface.CopyUv((float*)output);
                mesh.SetUVs(0, places, 0, count);
            }
            Grow(ref indices, surface.IndexCount);
            fixed (int* output = indices) surface.CopyIndices(output);
            mesh.SetIndices(indices, 0, surface.IndexCount, MeshTopology.Triangles, 0);
        }

        static void Grow<T>(ref T[] array, int count)
        {
            if (array.Length < count) array = new T[System.Math.Max(count, array.Length + array.Length / 2)];
        }

        void OnDisable()
        {
            Video?.Dispose();
            Video = null;
            Frame = -1;
            seconds = 0;
            foreach (var made in new Object[] { pictures, source, material, mesh })
                if (made != null) Destroy(made);
            pictures = null;
            source = null;
            try
            {
                if (folder != null) Directory.Delete(folder, true);
            }
            catch (IOException)
            {
                // The video player has its file open until the end of this frame on Windows: the system clears its cache.
            }
            folder = null;
        }
    }
}
