/** Addresses of the workers' files, after whatever a bundler did with them. */
export declare const files: { readonly worker: URL; readonly core: URL; readonly order: URL };
