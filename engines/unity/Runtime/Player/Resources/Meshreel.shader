// Colours of vertices, or the texture where a vertex has a place in it; without both, grey in the light of a head lamp.
Shader "Meshreel/Unlit"
{
    Properties
    {
        _MainTex ("Texture", 2D) = "white" {}
        _HasTexture ("Has a texture", Float) = 0
        _HasColors ("Has colours", Float) = 0
    }
    SubShader
    {
        Tags { "RenderType" = "Opaque" }
        Cull Off // surfaces of captures may be open
        Pass
        {
            CGPROGRAM
            #pragma vertex vert
            #pragma fragment frag
            #include "UnityCG.cginc"

            sampler2D _MainTex;
            float _HasTexture, _HasColors;

            struct Corner
            {
                float4 position : POSITION;
                float3 normal : NORMAL;
                fixed4 color : COLOR;
                float2 place : TEXCOORD0;
                UNITY_VERTEX_INPUT_INSTANCE_ID
            };

            struct Pixel
            {
                float4 position : SV_POSITION;
                float3 color : COLOR0;
                float2 place : TEXCOORD0;
                UNITY_VERTEX_OUTPUT_STEREO
            };

            Pixel vert(Corner corner)
            {
                Pixel pixel;
                UNITY_SETUP_INSTANCE_ID(corner);
                UNITY_INITIALIZE_OUTPUT(Pixel, pixel);
                UNITY_INITIALIZE_VERTEX_OUTPUT_STEREO(pixel);
                pixel.position = UnityObjectToClipPos(corner.position);
                pixel.place = corner.place;
                float3 eye = normalize(ObjSpaceViewDir(corner.position));
                pixel.color = _HasColors > 0.5 ? corner.color.rgb : 0.4 + 0.4 * abs(dot(eye, corner.normal));
                #ifndef UNITY_COLORSPACE_GAMMA
                pixel.color = GammaToLinearSpace(pixel.color);
                #endif
                return pixel;
            }

            fixed4 frag(Pixel pixel) : SV_Target
            {
                if (_HasTexture > 0.5 && pixel.place.x >= 0) return fixed4(tex2D(_MainTex, pixel.place).rgb, 1);
                return fixed4(pixel.color, 1);
            }
            ENDCG
        }
    }
}
