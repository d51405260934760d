// Meshes, and what a map of one is like.

// Two triangles for each cell of a grid; at(s, t) gives [x, y, z].
export function grid(columns, rows, at) {
  const positions = [], indices = [];
  for (let j = 0; j <= rows; ++j) for (let i = 0; i <= columns; ++i) positions.push(...at(i / columns, j / rows));
  for (let j = 0; j < rows; ++j) {
    for (let i = 0; i < columns; ++i) {
      const a = j * (columns + 1) + i, c = a + columns + 1;
      indices.push(a, a + 1, c + 1, a, c + 1, c);
    }
  }
  return {positions: Float32Array.from(positions), indices: Uint32Array.from(indices)};
}
export const bump = (n) => grid(n, n, (s, t) => [s, t, 0.6 * Math.exp(-16 * ((s - 0.5) ** 2 + (t - 0.5) ** 2))]);
// A tube with a lid left out at both ends.
export const tube = (n) => grid(n, n, (s, t) => [Math.cos(2 * Math.PI * s), Math.sin(2 * Math.PI * s), 2 * t].map(Math.fround));

// Twice the signed area of each triangle of UV by corner.
export function areas(uv) {
  const result = [];
  for (let i = 0; i < uv.length; i += 6) {
    result.push((uv[i + 2] - uv[i]) * (uv[i + 5] - uv[i + 1]) - (uv[i + 4] - uv[i]) * (uv[i + 3] - uv[i + 1]));
  }
  return result;
}

// Charts, and edges at which a set of UV of some primitives is torn. What counts are places, not vertices: those have normals as well.
export function measure(primitives, semantic) {
  const edges = new Map(), numbers = new Map(), parent = [];
  const numberOf = (key) => {
    if (!numbers.has(key)) {
      numbers.set(key, parent.length);
      parent.push(parent.length);
    }
    return numbers.get(key);
  };
  const root = (i) => { while (parent[i] !== i) i = parent[i] = parent[parent[i]]; return i; };
  for (const primitive of primitives) {
    const position = primitive.getAttribute('POSITION'), texcoord = primitive.getAttribute(semantic), indices = primitive.getIndices().getArray();
    const places = [], ends = [];
    for (let v = 0; v < position.getCount(); ++v) {
      places.push(position.getElement(v, []).join(' '));
      ends.push(numberOf(`${places[v]} ${texcoord.getElement(v, []).join(' ')}`));
    }
    for (let c = 0; c < indices.length; c += 3) {
      for (let k = 0; k < 3; ++k) {
        const [a, b] = [indices[c + k], indices[c + ((k + 1) % 3)]].sort((p, q) => (places[p] < places[q] ? -1 : 1));
        parent[root(ends[a])] = root(ends[b]);
        const key = `${places[a]} ${places[b]}`;
        if (!edges.has(key)) edges.set(key, new Set());
        edges.get(key).add(`${ends[a]} ${ends[b]}`);
      }
    }
  }
  const seams = [...edges.values()].filter((sides) => sides.size > 1).length;
  return {charts: parent.filter((p, i) => p === i && root(i) === i).length, seams};
}
