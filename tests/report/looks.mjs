// How much a textured model's look changed: the page's own pictures of both maps, from six sides.

export const VIEWS = { '+x': [1, 0, 0], '-x': [-1, 0, 0], '+y': [0, 1, 0], '-y': [0, -1, 0], '+z': [0, 0, 1], '-z': [0, 0, -1] };

// For each view of an open page in the mode "textured": the PSNR over the pixels that the model covers in both pictures
// (dB, of all three channels), their number, and with `keep` the pictures: of before, after, and 16 times the difference,
// as data URLs.
export function compareLooks(page, size, views = VIEWS, keep = false) {
  return page.evaluate(([all, side, keeps]) => {
    const toUrl = (rgba) => {
      const canvas = document.createElement('canvas');
      canvas.width = canvas.height = side;
      const image = new ImageData(side, side);
      for (let y = 0; y < side; ++y) image.data.set(rgba.subarray(4 * side * (side - 1 - y), 4 * side * (side - y)), 4 * side * y);
      canvas.getContext('2d').putImageData(image, 0, 0);
      return canvas.toDataURL();
    };
    return Object.entries(all).map(([view, direction]) => {
      const [before, after] = [0, 1].map((map) => window.planishReport.picture(map, direction, side));
      const difference = new Uint8Array(before.length).fill(255);
      let sum = 0, covered = 0;
      for (let i = 0; i < before.length; i += 4) {
        if (before[i + 3] !== 255 || after[i + 3] !== 255) continue;
        ++covered;
        for (let k = i; k < i + 3; ++k) {
          sum += (before[k] - after[k]) ** 2;
          difference[k] = 128 + Math.max(-127, Math.min(127, 16 * (after[k] - before[k])));
        }
      }
      const psnr = 10 * Math.log10(255 ** 2 / (sum / (3 * covered)));
      return { view, psnr, covered, ...(keeps ? { pictures: [before, after, difference].map(toUrl) } : {}) };
    });
  }, [views, size, keep]);
}
