//! The binary chunk, its buffer views and accessors, and the container around them.

use serde_json::{Map, Value, json};

use super::GlbError;

/// What a buffer view is for (glTF 2.0, `bufferView.target`).
#[derive(Clone, Copy)]
pub(super) enum Target {
    /// Vertex attributes.
    Vertices,
    /// Triangle indices.
    Indices,
    /// Anything that no GPU reads directly.
    Other,
}

/// A number as an accessor stores it.
pub(super) trait Component: Copy {
    /// Its number in the format (glTF 2.0, `accessor.componentType`).
    const CODE: u32;
    /// Appends it in little-endian order.
    fn put(self, bytes: &mut Vec<u8>);
}

macro_rules! component {
    ($type:ty, $code:literal) => {
        impl Component for $type {
            const CODE: u32 = $code;
            fn put(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }
        }
    };
}

component!(u8, 5121);
component!(u16, 5123);
component!(u32, 5125);
component!(f32, 5126);

/// The binary chunk while it grows; each accessor has a buffer view of its own, so that every one
/// starts at a multiple of four bytes.
#[derive(Default)]
pub(super) struct Binary {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Binary {
    /// Adds an accessor over elements of `N` numbers and returns its index.
    pub fn push<T: Component, const N: usize>(
        &mut self,
        target: Target,
        elements: &[[T; N]],
    ) -> usize {
        let shape = match N {
            1 => "SCALAR",
            2 => "VEC2",
            3 => "VEC3",
            4 => "VEC4",
            _ => "MAT4",
        };
        let start = self.bytes.len();
        for component in elements.iter().flatten() {
            component.put(&mut self.bytes);
        }
        let length = self.bytes.len() - start;
        let mut view = json!({ "buffer": 0, "byteOffset": start, "byteLength": length });
        match target {
            Target::Vertices => view["target"] = json!(34962),
            Target::Indices => view["target"] = json!(34963),
            Target::Other => {}
        }
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(view);
        self.accessors.push(json!({
            "bufferView": self.views.len() - 1,
            "componentType": T::CODE,
            "count": elements.len(),
            "type": shape,
        }));
        self.accessors.len() - 1
    }

    /// The same with the smallest and largest element, which positions and key times must state.
    pub fn push_bounded<const N: usize>(&mut self, target: Target, elements: &[[f32; N]]) -> usize {
        let index = self.push(target, elements);
        let (mut min, mut max) = ([f32::INFINITY; N], [f32::NEG_INFINITY; N]);
        for element in elements {
            for i in 0..N {
                min[i] = min[i].min(element[i]);
                max[i] = max[i].max(element[i]);
            }
        }
        let exact = |bounds: [f32; N]| Value::from(bounds.map(f64::from).to_vec());
        self.accessors[index]["min"] = exact(min);
        self.accessors[index]["max"] = exact(max);
        index
    }

    /// Completes the JSON text and packs both into a file.
    pub fn finish(self, mut root: Map<String, Value>) -> Result<Vec<u8>, GlbError> {
        if !self.bytes.is_empty() {
            root.insert(
                "buffers".into(),
                json!([{ "byteLength": self.bytes.len() }]),
            );
            root.insert("bufferViews".into(), Value::Array(self.views));
            root.insert("accessors".into(), Value::Array(self.accessors));
        }
        let mut json = Value::Object(root).to_string().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut chunks = vec![(*b"JSON", json)];
        if !self.bytes.is_empty() {
            chunks.push((*b"BIN\0", self.bytes));
        }

        let length = 12 + chunks.iter().map(|(_, data)| 8 + data.len()).sum::<usize>();
        let Ok(length32) = u32::try_from(length) else {
            return Err(GlbError::TooMany {
                what: "bytes".into(),
                count: length as u64,
                limit: u32::MAX.into(),
            });
        };
        let mut file = Vec::with_capacity(length);
        file.extend_from_slice(b"glTF");
        file.extend_from_slice(&2_u32.to_le_bytes());
        file.extend_from_slice(&length32.to_le_bytes());
        for (kind, data) in chunks {
            // Shorter than the whole, whose length has been checked.
            file.extend_from_slice(&(data.len() as u32).to_le_bytes());
            file.extend_from_slice(&kind);
            file.extend_from_slice(&data);
        }
        Ok(file)
    }
}
