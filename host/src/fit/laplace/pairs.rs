//! Which vertex of a scan follows which point of a template: proposed, written down, read back.
//!
//! A t-marker is a point of the template, a v-marker a vertex of the scan (de Aguiar et al. 2007,
//! section 3.2). The file is text that a person can edit:
//!
//! ```text
//! # sinew markers 1
//! reference-frame: 0
//! marker,vertex,x,y,z
//! LeftLeg-LeftFoot:1:front,4711,0.102,0.331,0.064
//! ```
//!
//! Where `vertex` is empty, the vertex nearest to x y z (metres) is taken. Without a line
//! `reference-frame`, no frame of the template need show the pose of the scan.

use std::collections::{HashMap, HashSet};
use std::fmt::Write as _;

use glam::DVec3;

use super::LaplaceError;
use super::align::Similarity;
use super::graph::Graph;
use super::nearest::Nearest;
use super::suggest::density;
use super::template::Template;

/// A t-marker and its v-marker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    /// Point of the template.
    pub point: u32,
    /// Vertex of the scan.
    pub vertex: u32,
}

/// All of them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Pairs {
    /// The template's frame in whose pose the scan stands. None where no frame shows it: how markers
    /// turn is then counted from where they are on the scan, or from a skeleton's rest pose.
    pub reference: Option<usize>,
    /// No point and no vertex twice.
    pub pairs: Vec<Pair>,
}

/// A marker is at most this far from the surface it was put on, metres, unless nothing is nearer.
const REACH: f64 = 0.25;

impl Pairs {
    /// Proposes `count` pairs, or one a point where the template has no more points than that.
    ///
    /// Points with a direction go out along it to the surface, others to the vertex nearest to
    /// them; of those, the ones that are farthest apart on the scan are taken. Bones offer points on
    /// all sides near both ends, so that markers stand on both sides of joints, to the tips of hands
    /// and toes.
    /// `scan`: positions `[vertices]` and triangles; `alignment`: template to scan, in
    /// `reference`. O(points log vertices + count edges log vertices)
    ///
    /// # Panics
    /// Where `reference` is no frame of the template.
    #[must_use]
    pub fn propose(
        template: &Template,
        reference: usize,
        alignment: &Similarity,
        scan: (&[DVec3], &[[u32; 3]]),
        count: usize,
    ) -> Self {
        let (positions, triangles) = scan;
        let used: HashSet<u32> = triangles.iter().flatten().copied().collect();
        let mut on_surface: Vec<u32> = used.into_iter().collect();
        on_surface.sort_unstable();
        let places: Vec<DVec3> = on_surface.iter().map(|&v| positions[v as usize]).collect();
        let tree = Nearest::new(&places);
        let rays = crate::spatial::Tree::new(triangles, positions);
        let all: Vec<u32> = (0..template.point_count() as u32).collect();
        let moved: Vec<DVec3> = template
            .positions(&all, reference)
            .into_iter()
            .map(|p| alignment.apply(p))
            .collect();
        let turned = (!template.outward.is_empty())
            .then(|| template.rotations(&all, 0, reference))
            .flatten();
        let vertex = |point: u32| -> Option<u32> {
            let at = moved[point as usize];
            let ray = turned.as_ref().and_then(|turned| {
                let out = turned[point as usize] * template.outward[point as usize];
                let hit = rays.first_hit(at, alignment.rotation * out)?;
                (hit.distance < REACH).then(|| {
                    let corners = triangles[hit.triangle];
                    let heaviest =
                        (0..3).max_by(|&a, &b| hit.barycentric[a].total_cmp(&hit.barycentric[b]));
                    corners[heaviest.unwrap_or(0)]
                })
            });
            ray.or_else(|| tree.find(at).map(|(index, _)| on_surface[index as usize]))
        };
        let mut taken = HashSet::new();
        let mut pairs: Vec<Pair> = Vec::new();
        let mut push = |pairs: &mut Vec<Pair>, point: u32| {
            if let Some(vertex) = vertex(point)
                && taken.insert(vertex)
            {
                pairs.push(Pair { point, vertex });
            }
        };
        all.iter().for_each(|&point| push(&mut pairs, point));
        if pairs.len() > count {
            pairs = farthest(scan, pairs, count);
        }
        Self {
            reference: Some(reference),
            pairs,
        }
    }

    /// The file's text. `scan`: positions `[vertices]`, metres.
    #[must_use]
    pub fn to_text(&self, template: &Template, scan: &[DVec3]) -> String {
        let mut text = String::from(
            "# sinew markers 1\n\
             # One line a marker: a point of the template, a vertex of the scan, where that is (m).\n\
             # Delete a line to drop a marker; empty the vertex to take the one nearest to x,y,z.\n",
        );
        if let Some(frame) = self.reference {
            let _ = writeln!(text, "reference-frame: {frame}");
        }
        text.push_str("marker,vertex,x,y,z\n");
        for &Pair { point, vertex } in &self.pairs {
            let label = &template.labels[point as usize];
            let [x, y, z] = scan[vertex as usize].to_array();
            // Labels of captures may hold commas; a quoted field is closed by its own quote.
            let label = if label.contains([',', '"', '#']) {
                format!("\"{}\"", label.replace('"', "\"\""))
            } else {
                label.clone()
            };
            let _ = writeln!(text, "{label},{vertex},{x:.5},{y:.5},{z:.5}");
        }
        text
    }

    /// Reads what [`Self::to_text`] wrote and a person changed.
    ///
    /// # Errors
    /// [`LaplaceError::MarkerLine`] with the line's number and what to change.
    pub fn from_text(
        text: &str,
        template: &Template,
        scan: &[DVec3],
    ) -> Result<Self, LaplaceError> {
        let points: HashMap<&str, u32> = template
            .labels
            .iter()
            .map(String::as_str)
            .zip(0..)
            .collect();
        let tree = Nearest::new(scan);
        let mut found = Self::default();
        let (mut seen_points, mut seen_vertices) = (HashSet::new(), HashSet::new());
        for (line, content) in (1..).zip(text.lines()) {
            let content = content.trim();
            let bad = |why: String| LaplaceError::MarkerLine { line, why };
            if content.is_empty() || content.starts_with('#') || content.starts_with("marker,") {
                continue;
            }
            if let Some(value) = content.strip_prefix("reference-frame:") {
                let value = value.trim();
                let frame = value.parse().ok().filter(|&f| f < template.frame_count());
                let count = template.frame_count();
                let why = || format!("frame {value:?}, where the template has {count}; correct it");
                found.reference = Some(frame.ok_or_else(|| bad(why()))?);
                continue;
            }
            let (label, rest) =
                split_label(content).ok_or_else(|| bad("give marker,vertex,x,y,z".to_owned()))?;
            let point = *points.get(label.as_str()).ok_or_else(|| {
                bad(format!(
                    "the template has no marker {label:?}; correct or delete it"
                ))
            })?;
            let fields: Vec<&str> = rest.split(',').map(str::trim).collect();
            let vertex = match fields[..] {
                ["", x, y, z] => {
                    let number = |text: &str| text.parse().ok().filter(|x: &f64| x.is_finite());
                    let place = number(x).zip(number(y)).zip(number(z));
                    let place = place.map(|((x, y), z)| DVec3::new(x, y, z));
                    let place =
                        place.ok_or_else(|| bad("x,y,z are no numbers; give metres".to_owned()))?;
                    tree.find(place).map_or(0, |(vertex, _)| vertex)
                }
                [vertex, ..] if !vertex.is_empty() => {
                    let number = vertex.parse().ok().filter(|&v| (v as usize) < scan.len());
                    number.ok_or_else(|| {
                        let count = scan.len();
                        bad(format!(
                            "vertex {vertex:?}, where the scan has {count}; correct it"
                        ))
                    })?
                }
                _ => return Err(bad("give a vertex, or a place x,y,z".to_owned())),
            };
            if !seen_points.insert(point) {
                return Err(bad(format!(
                    "marker {label:?} stands there twice; delete one"
                )));
            }
            if !seen_vertices.insert(vertex) {
                return Err(bad(format!(
                    "vertex {vertex} carries two markers; move one"
                )));
            }
            found.pairs.push(Pair { point, vertex });
        }
        if found.pairs.is_empty() {
            let why = "the file names no marker; let the bake propose some".to_owned();
            return Err(LaplaceError::MarkerLine { line: 1, why });
        }
        Ok(found)
    }

    /// Points of the template.
    #[must_use]
    pub fn points(&self) -> Vec<u32> {
        self.pairs.iter().map(|pair| pair.point).collect()
    }

    /// Vertices of the scan.
    #[must_use]
    pub fn vertices(&self) -> Vec<u32> {
        self.pairs.iter().map(|pair| pair.vertex).collect()
    }
}

/// A label, quoted or not, and what follows its comma.
fn split_label(line: &str) -> Option<(String, &str)> {
    let Some(quoted) = line.strip_prefix('"') else {
        let (label, rest) = line.split_once(',')?;
        return Some((label.trim().to_owned(), rest));
    };
    let mut label = String::new();
    let mut from = quoted;
    loop {
        let (part, rest) = from.split_once('"')?;
        label.push_str(part);
        match rest.strip_prefix('"') {
            Some(more) => {
                label.push('"');
                from = more;
            }
            None => return Some((label, rest.trim_start().strip_prefix(',')?)),
        }
    }
}

/// Those `count` of `pairs` that are farthest apart on the scan, twice as dense on its feet.
fn farthest(
    (positions, triangles): (&[DVec3], &[[u32; 3]]),
    pairs: Vec<Pair>,
    count: usize,
) -> Vec<Pair> {
    let graph = Graph::new(positions, triangles);
    let density = density(positions);
    let mut open = pairs;
    let mut chosen = vec![open.swap_remove(0)];
    let mut distances = graph.distances(&[chosen[0].vertex]);
    while chosen.len() < count && !open.is_empty() {
        let distance = |at: usize| {
            let vertex = open[at].vertex as usize;
            distances[vertex] * density[vertex]
        };
        let far = (0..open.len()).max_by(|&a, &b| distance(a).total_cmp(&distance(b)));
        let pair = open.swap_remove(far.unwrap_or(0));
        for (old, new) in distances.iter_mut().zip(graph.distances(&[pair.vertex])) {
            *old = old.min(new);
        }
        chosen.push(pair);
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    fn template() -> Template {
        let frame = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        let labels = vec!["A".into(), "odd, \"one\"".into(), "C".into()];
        Template::of_frames(vec![frame], vec![], labels, 100.0).expect("a template")
    }

    const SCAN: [DVec3; 4] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];

    #[test]
    fn what_is_written_is_read_again_and_may_be_edited() {
        let template = template();
        let triangles = [[0, 1, 2], [0, 2, 3]];
        let scan = (&SCAN[..], &triangles[..]);
        let pairs = Pairs::propose(&template, 0, &Similarity::IDENTITY, scan, 10);
        assert_eq!(pairs.vertices(), [0, 1, 2]);
        let text = pairs.to_text(&template, &SCAN);
        assert_eq!(
            Pairs::from_text(&text, &template, &SCAN).expect("reads"),
            pairs
        );
        let edited = text.replace("C,2,0.00000,1.00000,0.00000", "C,,0,0.1,0.8");
        let edited = Pairs::from_text(&edited, &template, &SCAN).expect("reads");
        assert_eq!(edited.vertices(), [0, 1, 3]);
    }

    #[test]
    fn faults_name_their_line() {
        let cases = [
            ("B,1,0,0,0", "no marker \"B\""),
            ("A,9,0,0,0", "vertex \"9\""),
            ("A,,x,0,0", "no numbers"),
            ("A,1\nA,2", "twice"),
            ("A,1\nC,1", "two markers"),
            ("reference-frame: 4\nA,1", "frame \"4\""),
            ("", "names no marker"),
            ("A", "give marker"),
        ];
        for (text, why) in cases {
            let error = Pairs::from_text(text, &template(), &SCAN).expect_err("refused");
            assert!(error.to_string().contains(why), "{text:?}: {error}");
        }
    }
}
