// The first page that the site's search finds for each word: node search.js LUNR INDEX WORD...
// Fields and boosts are those of Material for MkDocs.
const fs = require("fs")
const [lunrFile, indexFile, ...words] = process.argv.slice(2)
const lunr = require(lunrFile)
const { docs } = JSON.parse(fs.readFileSync(indexFile, "utf8"))
const index = lunr(function () {
  this.ref("location")
  this.field("title", { boost: 1e3 })
  this.field("text")
  docs.forEach((doc) => this.add(doc, { boost: doc.boost ?? 1 }))
})
const found = {}
for (const word of words) {
  const terms = word.split(" ").map((term) => `+${term}`).join(" ")
  const pages = index.search(terms).map((hit) => hit.ref.split("#")[0])
  found[word] = [...new Set(pages)].slice(0, 3)
}
console.log(JSON.stringify(found))
