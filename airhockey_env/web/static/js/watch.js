/** The page "Watch". */
