// AR of phones whose browser has no WebXR: an app of the phone shows a file that the page names. Quick Look (iOS) takes USDZ, Scene Viewer (Android) GLB.

/** Link that opens the app with its file at true size; null where the phone has none, or the page names no file for it. */
export function phoneLink({ usdz, glb }: { readonly usdz: string; readonly glb: string }): HTMLAnchorElement | null {
  const link = document.createElement("a");
  const file = fileOf(usdz);
  const model = fileOf(glb);
  if (file !== null && link.relList.supports?.("ar")) {
    file.hash ||= "allowsContentScaling=0";
    link.rel = "ar";
    link.append(document.createElement("img")); // without one Safari shows a page of the file
    link.href = file.href;
  } else if (model !== null && /android/i.test(navigator.userAgent) && !/firefox|oculus/i.test(navigator.userAgent)) {
    const query = new URLSearchParams({ file: model.href, mode: "ar_preferred", resizable: "false" });
    const fallback = encodeURIComponent(location.href); // where the app is missing
    link.href = `intent://arvr.google.com/scene-viewer/1.0?${query}#Intent;scheme=https;package=com.google.android.googlequicksearchbox;action=android.intent.action.VIEW;S.browser_fallback_url=${fallback};end;`;
  } else return null;
  return link;
}

/** Address of a file that the page names; null for none, and for what is no address of a file. */
function fileOf(name: string): URL | null {
  const file = name !== "" && URL.canParse(name, document.baseURI) ? new URL(name, document.baseURI) : null;
  return file !== null && /^(https?|blob):$/.test(file.protocol) ? file : null;
}
