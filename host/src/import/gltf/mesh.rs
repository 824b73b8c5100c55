//! Primitives into one mesh with influences (glTF 2.0, section 3.7.2 "Geometry").

use std::collections::BTreeMap;

use glam::DVec3;
use gltf::json::accessor::Type;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;

use super::accessor::{Reader, Storage};
use super::hierarchy::Hierarchy;
use super::morph::Morphs;
use super::primitive::{Range, attribute, corners, decoration, influences, same_count, vertex_key};
use super::skin::Binds;
use super::{checked, item_fault};
use crate::import::{ImportError, ImportErrorKind, RawMesh, RawPrimitive};

/// What a primitive counts for beside its numbers, so that many nodes that share a mesh of many
/// empty primitives cannot take forever.
const PRIMITIVE_COST: u64 = 256;

/// A mesh on a node.
pub(super) struct Instance {
    pub node: usize,
    pub mesh: usize,
    /// `None` for a mesh that hangs rigidly on its node.
    pub skin: Option<usize>,
}

/// The merged meshes.
pub(super) struct Surface {
    pub mesh: RawMesh,
    pub influences: Vec<Vec<(u32, f64)>>,
    pub morphs: Morphs,
}

/// The meshes of the scene in node order.
pub(super) fn instances(
    reader: &mut Reader<'_>,
    hierarchy: &Hierarchy,
) -> Result<Vec<Instance>, ImportError> {
    let document = reader.document;
    let mut instances = Vec::new();
    for (i, node) in document.nodes.iter().enumerate() {
        let Some(mesh) = node.mesh.filter(|_| hierarchy.in_scene[i]) else {
            continue;
        };
        let item = format!("nodes[{i}]");
        let mesh = checked(&document.meshes, mesh.value(), "mesh", &item)?;
        let skin = match node.skin {
            Some(skin) => Some(checked(&document.skins, skin.value(), "skin", &item)?),
            None => None,
        };
        instances.push(Instance {
            node: i,
            mesh,
            skin,
        });
    }
    Ok(instances)
}

/// Reads all instances, one after another.
pub(super) fn read(
    reader: &mut Reader<'_>,
    instances: &[Instance],
    binds: &Binds,
    stem: &str,
) -> Result<Surface, ImportError> {
    let document = reader.document;
    let mut builder = Builder::default();
    for instance in instances {
        let mesh = &document.meshes[instance.mesh];
        let item = format!("meshes[{}]", instance.mesh);
        builder.morphs.begin(reader, instance)?;
        // Primitives often share their vertices and differ in indices only.
        let mut read_before = BTreeMap::new();
        for (i, primitive) in mesh.primitives.iter().enumerate() {
            let item = format!("{item}.primitives[{i}]");
            reader.charge(PRIMITIVE_COST, &item)?;
            let Checked::Valid(mode) = primitive.mode else {
                let kind = ImportErrorKind::OutOfRange {
                    what: "mode".into(),
                    value: "something else".into(),
                    expected: "0 to 6".into(),
                };
                return Err(item_fault(kind, item));
            };
            if !matches!(
                mode,
                Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
            ) {
                reader.notice(
                    item,
                    format!("{mode:?} skipped: only triangles make a surface"),
                );
                continue;
            }
            let range = match read_before.get(&vertex_key(primitive)) {
                Some(&range) => range,
                None => {
                    let range = builder.vertices(reader, primitive, instance, binds, &item)?;
                    read_before.insert(vertex_key(primitive), range);
                    range
                }
            };
            let corners = corners(reader, primitive, mode, range, &item)?;
            let node_name = document.nodes[instance.node].name.as_ref();
            let name = mesh.name.as_ref().or(node_name);
            builder.mesh.primitives.push(RawPrimitive {
                name: name
                    .cloned()
                    .unwrap_or_else(|| format!("meshes[{}]", instance.mesh)),
                polygon_sizes: vec![3; corners.len() / 3],
                corners,
            });
        }
    }
    let mut names = builder
        .mesh
        .primitives
        .iter()
        .map(|primitive| &primitive.name);
    let first = names.next();
    let single = first.filter(|first| names.all(|name| name == *first));
    builder.mesh.name = single.cloned().unwrap_or_else(|| stem.to_owned());
    builder.finish(reader)
}

/// The surface while it grows; every list has one entry a vertex.
#[derive(Default)]
struct Builder {
    mesh: RawMesh,
    influences: Vec<Vec<(u32, f64)>>,
    /// Zero where the file states none.
    normals: Vec<DVec3>,
    tangents: Vec<[f64; 4]>,
    texcoords: Vec<[f64; 2]>,
    /// How many vertices came with each of the three.
    stated: [usize; 3],
    morphs: Morphs,
}

impl Builder {
    fn vertices(
        &mut self,
        reader: &mut Reader<'_>,
        primitive: &Primitive,
        instance: &Instance,
        binds: &Binds,
        item: &str,
    ) -> Result<Range, ImportError> {
        let attribute = |name| attribute(primitive, name);
        let Some(index) = attribute(Semantic::Positions) else {
            let what = "the attribute POSITION".into();
            return Err(item_fault(ImportErrorKind::Missing { what }, item));
        };
        let positions = reader.read_vectors(index, Storage::Quantised, "POSITION", item)?;
        let accessor = &reader.document.accessors[index];
        if accessor.buffer_view.is_none() && accessor.sparse.is_none() {
            let what = "the data of POSITION (compressed by an extension?)".into();
            let place = format!("accessors[{index}]");
            return Err(item_fault(ImportErrorKind::Missing { what }, place));
        }
        let (first, count) = (self.mesh.positions.len(), positions.len());
        if u32::try_from(first + count).is_err() {
            let kind = ImportErrorKind::TooMany {
                what: "vertices".into(),
                count: (first + count) as u64,
                limit: u32::MAX.into(),
            };
            return Err(item_fault(kind, item));
        }
        self.mesh.positions.extend(positions);

        if let Some(index) = attribute(Semantic::Normals) {
            let normals = reader.read_vectors(index, Storage::Quantised, "NORMAL", item)?;
            same_count(count, normals.len(), "NORMAL", item)?;
            let unit = |n: DVec3| n.normalize_or_zero();
            self.normals.extend(normals.into_iter().map(unit));
            self.stated[0] += count;
        }
        if let Some(index) = attribute(Semantic::Tangents)
            && let Some(numbers) = decoration(reader, index, Type::Vec4, "TANGENT", item)?
        {
            same_count(count, numbers.len() / 4, "TANGENT", item)?;
            self.tangents.extend(numbers.as_chunks().0);
            self.stated[1] += count;
        }
        if let Some(index) = attribute(Semantic::TexCoords(0))
            && let Some(numbers) = decoration(reader, index, Type::Vec2, "TEXCOORD_0", item)?
        {
            same_count(count, numbers.len() / 2, "TEXCOORD_0", item)?;
            self.texcoords.extend(numbers.as_chunks().0);
            self.stated[2] += count;
        }
        self.normals.resize(first + count, DVec3::ZERO);
        self.tangents.resize(first + count, [0.0; 4]);
        self.texcoords.resize(first + count, [0.0; 2]);

        let influences = match instance.skin {
            None => vec![vec![(binds.of_node(instance.node), 1.0)]; count],
            Some(skin) => influences(reader, primitive, binds.of_skin(skin), count, item)?,
        };
        self.influences.extend(influences);
        self.morphs
            .targets(reader, primitive, (first, count), item)?;
        Ok((first, count))
    }

    fn finish(mut self, reader: &mut Reader<'_>) -> Result<Surface, ImportError> {
        let count = self.mesh.positions.len();
        let [normals, tangents, texcoords] = self.stated;
        if normals > 0 {
            self.repair_normals(reader);
            self.mesh.normals = Some(self.normals);
        }
        if tangents == count && count > 0 {
            self.mesh.tangents = Some(self.tangents);
        } else if tangents > 0 {
            reader.notice("meshes", "tangents dropped: not every primitive has them");
        }
        if texcoords > 0 {
            if texcoords < count {
                let missing = count - texcoords;
                let text = format!("{missing} vertices without texture coordinates got 0, 0");
                reader.notice("meshes", text);
            }
            self.mesh.texcoords = Some(self.texcoords);
        }
        self.mesh.morphs = self.morphs.merge(reader, count)?;
        Ok(Surface {
            mesh: self.mesh,
            influences: self.influences,
            morphs: self.morphs,
        })
    }

    /// Gives vertices without a normal the area-weighted mean of their triangles' normals.
    fn repair_normals(&mut self, reader: &mut Reader<'_>) {
        let zero = |normal: &DVec3| *normal == DVec3::ZERO;
        let missing: Vec<bool> = self.normals.iter().map(zero).collect();
        let missing_count = missing.iter().filter(|&&missing| missing).count();
        if missing_count == 0 {
            return;
        }
        for primitive in &self.mesh.primitives {
            let (triangles, _) = primitive.corners.as_chunks::<3>();
            for triangle in triangles {
                let triangle = triangle.map(|corner| corner as usize);
                let [a, b, c] = triangle.map(|corner| self.mesh.positions[corner]);
                for corner in triangle.into_iter().filter(|&corner| missing[corner]) {
                    self.normals[corner] += (b - a).cross(c - a);
                }
            }
        }
        for (normal, _) in self.normals.iter_mut().zip(missing).filter(|(_, m)| *m) {
            // A vertex of no proper triangle has no normal of its own.
            *normal = normal.normalize_or(DVec3::Y);
        }
        let text = format!("{missing_count} vertices without a normal got their triangles' mean");
        reader.notice("meshes", text);
    }
}
