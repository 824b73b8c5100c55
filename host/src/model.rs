//! Validated meshes, skeletons, skins and clips: what every stage after import works on.
