// The part of draco3d that @types/draco3d leaves out.
declare module "draco3d/draco_decoder_nodejs.js" {
  import type { DecoderModule } from "draco3d";
  export default function createDecoderModule(options: { wasmBinary: ArrayBuffer }): Promise<DecoderModule>;
}
